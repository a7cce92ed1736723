"""Say in one sentence what is wrong with a scene: the file, the key, the fault, a guess."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel, Tag, ValidationError
from pydantic_core import ErrorDetails

from nldyn.base.errors import SceneError, nearest

KeyPath = tuple[str | int, ...]
MOST_SHOWN, LONGEST_SHOWN = 20, 60  # names in a list, letters of a name
BETWEEN = "what joins two interfaces is [[springs]] and [[dampers]] with 'at' and 'against'"
WORDS = {  # that users try for a table, and what there is
    "force": "forces are [[excitation]] of kind 'harmonic', 'constant' or 'measured'",
    "load": "loads are [[excitation]] of kind 'harmonic', 'constant', 'measured' or 'weight'",
    "gravity": "gravity is [[excitation]] of kind 'weight', with 'acceleration'",
    "weight": "weight is [[excitation]] of kind 'weight', with 'acceleration'",
    "base": "a motion of the supports is [[excitation]] of kind 'base'",
    "unbalance": "an unbalance is [[excitation]] of kind 'unbalance'",
    "contact": "contacts are [[stops]]",
    "gap": "a gap is a key of [[stops]]",
    "clearance": "a clearance is 'gap' of [[stops]], or one all around: [[round_clearances]]",
    "ring": "rings and pins are [[round_clearances]]",
    "impact": "impacts are computed at [[stops]]",
    "dashpot": "dashpots are [[dampers]]; that of a stop is a key of [[stops]]",
    "nonlinear_spring": f"nonlinear springs that push on contact are [[stops]]; {BETWEEN}",
    "connection": f"{BETWEEN}; what joins [components.NAME] is [[joints]]",
    "connector": BETWEEN,
    "constraint": "what is held is in [[supports]], what is joined in [[couplings]]",
    "boundary_condition": "what is held is in [[supports]]",
    "material": "materials are in [parts.NAME]",
    "section": "sections are in [parts.NAME]",
    "mass": "masses on a mesh are [[point_masses]]; a mass matrix is in [matrices]",
    "stiffness": "a stiffness matrix is in [matrices]; springs are [[springs]]",
    "mode": "modes are given in [modal], or chosen in [reduction]",
    "frequency": "the range of frequencies is range_hz in [continuation]",
    "sweep": "the range of frequencies is range_hz in [continuation]",
    "simulation": "a simulation is not part of a scene; there is nldyn.simulate in Python",
    "gyroscopic": "a gyroscopic matrix is a key of [matrices]",
}
ORDERS = (
    "all [[excitation]] acts at multiples 'harmonic' of one frequency, that of the continuation: "
    "where half orders act let it be that of the whole cycle, and of two frequencies one of which "
    "both are multiples, nearly (5 and 7 for a ratio of 1.4); a harmonic force with a "
    "'frequency_hz' of its own can be simulated in Python"
)
NONE_CHOSEN = "none_chosen"  # fault of a key that says which of several tables is meant
BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def scene_error(file: Path, key: KeyPath, fault: str, sep: str = " ") -> SceneError:
    """Make the error for one key of one scene file."""
    name = format_key(key)
    return SceneError(printable(f"{file}: {name}{sep}{fault}" if name else f"{file}: {fault}"))


def printable(text: str) -> str:
    r"""Write what a terminal would obey, such as the end of a line, as an escape.

    Examples
    --------
    >>> print(printable("two\nlines"))
    two\nlines
    """
    if text.isprintable():
        return text
    return "".join(
        letter if letter.isprintable() else letter.encode("unicode_escape").decode()
        for letter in text
    )


def format_key(key: KeyPath) -> str:
    """Write a key as a user would: ``stops[0].stiffness``, entries counted from 0.

    Examples
    --------
    >>> format_key(("stops", 0, "at")), format_key(("parts", "left arm"))
    ('stops[0].at', 'parts."left arm"')
    """
    text = ""
    for step in key:
        if isinstance(step, int):
            text += f"[{step}]"
        else:
            text += ("." if text else "") + _key_step(step)
    return text


def _key_step(step: str) -> str:
    short = shortened(step)
    return short if BARE_KEY.fullmatch(step) else json.dumps(short, ensure_ascii=False)


def shortened(name: str) -> str:
    """A name, or the beginning of a long one."""
    return name if len(name) <= LONGEST_SHOWN else name[: LONGEST_SHOWN - 3] + "..."


def quoted(names: Iterable[str]) -> str:
    """List names in quotes, in their own order, the first ones of many."""
    every = list(names)
    text = ", ".join(f"'{shortened(name)}'" for name in every[:MOST_SHOWN])
    more = len(every) - MOST_SHOWN
    return (text or "none") + (f" and {more} more" if more > 0 else "")


def unknown_name(name: str, known: Iterable[str], what: str) -> str:
    """Say that ``name`` is not among ``known``, with the likely one or with all of them."""
    names = list(known)
    guess = nearest(name, names)
    hint = f"did you mean '{guess}'?" if guess else f"known: {quoted(names)}"
    return f"'{shortened(name)}' is not {what}; {hint}"


def from_validation(file: Path, model: type[BaseModel], error: ValidationError) -> SceneError:
    """Turn pydantic's report into one sentence for each fault, all in a line.

    Unknown keys come first. What else is wrong in their tables may come of those that are
    misspelt, and is not told.
    """
    details = error.errors(include_url=False)
    unknown = [d for d in details if d["type"] == "extra_forbidden"]
    of_no_table = [d["loc"] for d in unknown if not _which_have_it(model, d["loc"])]
    misspelt = {_own_steps(model, key[:-1]) for key in of_no_table}
    told: dict[KeyPath, str] = {}
    for detail in (*unknown, *details):
        key = _own_steps(model, detail["loc"])
        if detail["type"] == NONE_CHOSEN:
            key = (*key, str(detail["ctx"]["key"]))
        if detail["type"] == "extra_forbidden" or key[:-1] not in misspelt:
            told.setdefault(key, _fault(model, detail))
    return scene_error(file, *joined(list(told.items())))


def joined(faults: Sequence[tuple[KeyPath, str]]) -> tuple[KeyPath, str]:
    """The key of the first of some faults, and one sentence with all of them."""
    (key, first), *others = faults[:MOST_SHOWN]
    return key, "".join([first, *(f"; also {format_key(key)} {fault}" for key, fault in others)])


def _own_steps(model: type[BaseModel], key: KeyPath) -> KeyPath:
    """The steps of a key that are a user's, without those of pydantic into one of several types."""
    return _walked(model, key)[0]


def _walked(model: type[BaseModel], key: KeyPath) -> tuple[KeyPath, Any]:
    """The steps of a key that are a user's, as far as they lead, and the type that is there."""
    here: Any = model
    steps: list[str | int] = []
    for step in key:
        here = _bare(here)
        tagged = _tags(here).get(str(step))
        if tagged is not None:  # a step into one of several types
            here = tagged
            continue
        if isinstance(here, type) and issubclass(here, BaseModel):
            field = here.model_fields.get(str(step))
            here = _without_none(field.annotation) if field else None
        elif get_origin(here) in (list, dict):
            here = get_args(here)[-1]
        else:
            return tuple(steps), None
        steps.append(step)
    return tuple(steps), here


def _tags(annotation: Any) -> dict[str, Any]:
    """The types with tags among several."""
    return {
        str(each.tag): option
        for option in get_args(annotation)
        for each in get_args(option)[1:]
        if isinstance(each, Tag)
    }


def _fault(model: type[BaseModel], detail: ErrorDetails) -> str:
    kind, given, context = detail["type"], detail["input"], detail.get("ctx", {})
    if kind == "extra_forbidden":
        return _unknown_key(model, detail["loc"])
    if kind == "missing":
        fields = [table.model_fields for table in _chosen_from(model, detail["loc"]).values()]
        name = str(detail["loc"][-1])
        own = any(name not in each or not each[name].is_required() for each in fields)
        return f"is missing: {detail['loc'][-2]} needs it" if own else "is missing"
    if kind == NONE_CHOSEN:
        if context["key"] not in given:
            return "is missing"
        return f"must be {context['expected']}, not {show(given[context['key']])}"
    if kind == "value_error":
        return str(context["error"])
    if kind == "literal_error":
        return f"must be {context['expected']}, not {show(given)}"
    if kind == "too_short" and not given:
        return "must not be empty"
    if kind == "list_type" and isinstance(given, dict) and tables_at(model, (*detail["loc"], 0)):
        return f"must be written with two brackets: [[{format_key(detail['loc'])}]]"
    if kind == "dict_type" and isinstance(given, list):
        return f"must be written with a name: [{format_key(detail['loc'])}.NAME]"
    if kind == "model_type":
        return f"must be a table: [{format_key(_own_steps(model, detail['loc']))}]"
    wanted = f"must be {_wanted(kind, context)}, not {show(given)}"
    return f"{wanted}: {ORDERS}" if detail["loc"][-1] == "harmonic" else wanted


def _wanted(kind: str, context: Mapping[str, Any]) -> str:
    """Describe what a value should have been."""
    bounds = {
        "greater_than": "greater than {gt:g}",
        "greater_than_equal": "at least {ge:g}",
        "less_than": "less than {lt:g}",
        "less_than_equal": "at most {le:g}",
        "too_long": "a list of at most {max_length} values",
        "too_short": "a list of at least {min_length} values",
    }
    if kind in bounds:
        return bounds[kind].format(**context)
    kinds = {
        "finite_number": "a finite number",
        "float_type": "a number",
        "int_type": "a whole number",
        "bool_type": "true or false",
        "string_type": "text in quotes",
        "list_type": "a list in square brackets",
        "dict_type": "a table",
    }
    return kinds.get(kind, "something else")


def show(value: object) -> str:
    """Show a value as it stands in a TOML file, shortened."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a table"
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."


def _unknown_key(model: type[BaseModel], key: KeyPath) -> str:
    """Guess the key that was meant: here first, then the same word in another table."""
    name = str(key[-1])
    if len(key) == 1 and (hint := _word(name)):
        return f"is not a table of a scene: {hint}"
    if key[0] == "springs" and name in ("between", "to", "from"):
        return f"is not a known key: {BETWEEN}"
    if others := _which_have_it(model, key):
        return f"is not a key of {key[-2]}, but of {' and '.join(others)}"
    if key[0] == "excitation" and name.startswith("frequency"):
        return f"is not a known key: {ORDERS}"
    known = [name for table in tables_at(model, key[:-1]) for name in table.model_fields]
    guess = nearest(name, known)
    if guess:
        return f"is not a known key; did you mean '{guess}'?"
    elsewhere = [path for path in all_keys(model) if path.rsplit(".", 1)[-1] == name]
    if elsewhere:
        return f"is not a known key here; did you mean {elsewhere[0]}?"
    return f"is not a known key; known here: {quoted(known)}"


def _word(name: str) -> str | None:
    """What there is instead of a word, in the singular or the plural, that users try."""
    word = name.lower()
    return next(
        (WORDS[w] for w in (word, word[:-1], word[:-2], word[:-3] + "y") if w in WORDS), None
    )


def _chosen_from(model: type[BaseModel], key: KeyPath) -> dict[str, type[BaseModel]]:
    """The tables by tags of which one was chosen that a key is in; none where there is but one."""
    several = _tags(_bare(_walked(model, key[:-2])[1])) if len(key) > 2 else {}
    return {tag: _bare(each) for tag, each in several.items() if key[-2] in several}


def _which_have_it(model: type[BaseModel], key: KeyPath) -> list[str]:
    """Tags of the tables, one of which was chosen, that have the key of a path."""
    tables = _chosen_from(model, key).items()
    return [tag for tag, table in tables if str(key[-1]) in table.model_fields]


def tables_at(model: type[BaseModel], key: KeyPath) -> list[type[BaseModel]]:
    """Find the table that a key path leads to, or the several that may be there."""
    here = _bare(_walked(model, key)[1])
    return [] if get_origin(here) in (list, dict) else list(_tables_in(here))


def all_keys(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """List every key of a schema, outer tables first: ``stops``, ``stops.at``, ...

    The user's own names in a table of tables are written ``NAME``.
    """
    for name, field in model.model_fields.items():
        path = f"{prefix}{name}"
        yield path
        if get_origin(_without_none(field.annotation)) is dict:
            path += ".NAME"
        for table in _tables_in(field.annotation):
            yield from all_keys(table, path + ".")


def _tables_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """The tables that a type is, holds or allows."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for inner in get_args(annotation):
        yield from _tables_in(inner)


def _bare(annotation: Any) -> Any:
    """A type without what is annotated."""
    while get_origin(annotation) is Annotated:
        annotation = get_args(annotation)[0]
    return annotation


def _without_none(annotation: Any) -> Any:
    """Take the ``None`` out of an optional type."""
    options = [a for a in get_args(annotation) if a is not type(None)]
    return options[0] if type(None) in get_args(annotation) else annotation
