"""Experiment files: what they may say, and the tasks that they ask for.

``values``: numbers.  ``scenes``, ``sizes``, ``tables``: the keys, one class a table.
``settings``: a method's.  ``profiles``: files of pieces.  ``reading``: TOML to tables.  ``lines``:
where a mistake stands.  ``specification``: scenes as plain numbers.  ``tasks``: one solve each,
with its key.
"""
