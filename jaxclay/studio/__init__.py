"""The interactive modeller: a pentagon pushed against turning clay (Figs. 6 and 7 of the paper).

``modeller``: strokes in, shapes out, undo, pieces; plain Python that knows no browser.
``drawing``: a stroke under way, its steps and what is shown between them.  ``reading``: what there
is to read off.  ``tool``: where the pentagon presses, and its way in equal steps.  ``solving``:
certified answers on slices whose programs are compiled.  ``starts``: pieces to begin from.
``messages``: what a page may ask, ``checked``, and ``answers``: what it is told.  ``widget``: the
same in Jupyter, :class:`Studio`.  ``host``: a page of its own, ``jaxclay studio``.
``static/studio.js``: the one front end of both.

May import all rooms to its left but experiments, which does not know this one either.
"""


def __getattr__(name: str):
    """:class:`Studio`, loaded when asked for, since it needs anywidget."""
    if name == "Studio":
        from jaxclay.studio.widget import Studio

        return Studio
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
