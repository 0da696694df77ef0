"""Pictures of results, from their columns alone: whatever the columns allow is drawn.

``standard``: which there are.  ``panels``: lines in one panel.  ``heat``: shares of failures.
``maps``: marks over two inputs.  ``accuracy``: the whole of a population.  ``layout``: figures of
panels.  ``series``: names and looks of lines.  ``statistics``: the figures behind them.
``marks``: how a solve ended.
"""
