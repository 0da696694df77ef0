"""Pictures of results, from their columns alone: whatever the columns allow is drawn.

``standard``: which there are.  ``panels``: lines in one panel, and the figures behind them.
``population``: all in one picture.  ``maps``: marks over two inputs.  ``shared``: figures of
panels, names and looks of lines, and marks of how a solve ended.
"""
