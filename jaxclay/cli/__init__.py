"""The commands: arguments to calls, nothing else.

``main``: all of them.  ``deform``: squash a profile, by ``squashes`` in the file's heights.
``experiments``: compare, atlas, sweep, report and agree.  ``studio``: the interactive modeller.
``starting``: until they are imported.

It may import every other room.
"""
