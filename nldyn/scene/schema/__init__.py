"""What may stand in a scene file: one class per table, one attribute per key.

The docstring of a key begins with its unit in square brackets; ``docs/_site/scene_keys.py``
makes the tables of ``docs/reference/scene.md`` of them. A class here checks what can be judged
inside one table; what joins two tables is checked in ``nldyn.scene.checks``.
"""
