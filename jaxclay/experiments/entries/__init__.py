"""Experiment files: what they may say, and the tasks that they ask for.

``values``: numbers, and a method's settings.  ``scenes``, ``tables``: the keys, one class a table.
``reading``: TOML to tables, and in which line a mistake stands.  ``specification``: scenes as
plain numbers.  ``tasks``: one solve each, with its key.
"""
