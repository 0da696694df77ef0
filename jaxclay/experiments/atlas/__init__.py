"""Failure atlas: which method solves which scene, and how the others fail (extra ``compare``)."""
