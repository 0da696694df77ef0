"""The commands: arguments to calls, nothing else.

``main``: all of them.  ``deform``: squash a profile.

It may import every other room.
"""
