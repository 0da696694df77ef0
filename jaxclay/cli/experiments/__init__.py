"""The commands ``compare``, ``atlas``, ``sweep``, ``report`` and ``agree``.

``options``: what they take.  ``editing``: packaged experiments, edited by it.  ``command``: runs
them and tells what is found, ``progress`` how far they are.  ``agree``: a verdict, told.
"""
