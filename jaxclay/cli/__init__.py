"""The commands: arguments to calls, nothing else.

``main``: all of them.  ``deform``: squash a profile.  ``starting``: until they are imported.

It may import every other room.
"""
