"""Kinds of arguments: what the annotation and the name of a parameter allow, and in which words.

`check_arguments` checks the arguments of public functions by them. Nothing here knows a structure:
classes are named in `CLASSES`, numbers whose names mean the same in all functions in `RANGES`, both
in `argument_vocabulary`. An annotation may be more precise by ``Annotated[type, note]``: a text
replaces the words made from the type, a `Range` limits a number, a `Kind` or a function that makes
one from type and name replaces all.
"""

import types
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from numbers import Integral, Real
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import numpy as np

from equimorph.argument_vocabulary import CLASSES, FINITE, RANGES, WHOLE, Range

SHOWN = 80
"""Characters of a refused value that a message shows."""


@dataclass(frozen=True)
class Kind:
    """What an argument may be.

    Parameters
    ----------
    words, several
        What is allowed, for one value and for a list of such.
    fits
        Whether a value is allowed as it is.
    convert
        Value that fits, made of one of another form, like an array of a list; None if there is no
        such form. It raises TypeError or ValueError for anything else.
    culprit
        The part of a value that does not fit, in words.
    holds
        Names of the classes whose objects may occur in it.
    by_name
        Whether it may give values of parameters by their names.
    """

    words: str
    several: str
    fits: Callable[[Any], bool]
    convert: Callable[[Any], Any] | None = None
    culprit: Callable[[Any], str] | None = None
    holds: frozenset[str] = frozenset()
    by_name: bool = False

    def refused(self, value: Any) -> str:
        """The part of a value that does not fit, in one line."""
        return short(value) if self.culprit is None else self.culprit(value)


def short(value: Any) -> str:
    """Value in one line of at most `SHOWN` characters."""
    try:
        text = " ".join(repr(value).split())
    except Exception:  # a value may be anything; so may its representation
        text = f"an object of {type(value).__name__}"
    return text if len(text) <= SHOWN else f"{text[: SHOWN - 4]} ..."


def is_number(value: Any) -> bool:
    """Whether a value is a real number: no text, no truth value, no complex number."""
    kind = type(value)
    return kind is float or (kind is not bool and isinstance(value, Real))


def is_listed(value: Any) -> bool:
    """Whether a value is a list, a tuple or an array, no text."""
    if type(value) in (tuple, list):
        return True
    if isinstance(value, np.ndarray):
        return value.ndim > 0
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def is_mapping(value: Any) -> bool:
    """Whether a value is a mapping."""
    return type(value) is dict or isinstance(value, Mapping)


ANYTHING = Kind("anything", "anything", lambda _: True)
"""By ``Annotated[T, ANYTHING]``, types with a language of their own, which its reader checks. A
text there tells what is allowed, in place of words made from the type."""
TEXT = Kind("a text", "names", lambda value: isinstance(value, str))
TRUTH = Kind("True or False", "truth values", lambda value: isinstance(value, bool | np.bool_))
NOTHING = Kind("None", "None", lambda value: value is None)


def _holds_numbers(value: Any) -> bool:
    try:
        return np.asarray(value).dtype.kind in "iuf" and not isinstance(value, str)
    except ValueError:  # rows of different lengths
        return False


NUMBERS = Kind("numbers, nan where there is none", "lists of numbers", _holds_numbers)


def kind_of(annotation: Any, name: str) -> Kind:
    """Kind of the parameter called `name` with an annotation; `ANYTHING` where it says nothing."""
    origin = get_origin(annotation)
    if origin is Annotated:
        plain, note, *_ = get_args(annotation)
        return _kind_of_note(plain, note, name)
    if origin in (Union, types.UnionType):
        return _either([kind_of(each, name) for each in get_args(annotation)])
    for applies, make in MAKERS:
        if applies(annotation, origin):
            return make(annotation, name)
    return ANYTHING


def _kind_of_note(plain: Any, note: Any, name: str) -> Kind:
    """Kind of an annotation that says more than its type."""
    if isinstance(note, Kind):
        return note
    if isinstance(note, Range):
        return number_kind(plain, name, note)
    if isinstance(note, str):
        return replace(kind_of(plain, name), words=note, several=note)
    return note(plain, name) if callable(note) else kind_of(plain, name)


def number_kind(annotation: Any, name: str, limits: Range | None = None) -> Kind:
    """Kind of a number, whole if the annotation is int, in limits or those of its name."""
    whole = annotation is int
    allowed = limits or RANGES.get(name, WHOLE if whole else FINITE)

    def fits(value: Any) -> bool:
        if not is_number(value) or (whole and not isinstance(value, Integral)):
            return False
        small = whole or isinstance(value, float) or FINITE.holds(value)
        return small and allowed.holds(value)

    def convert(value: Any) -> float:
        number = value.item() if isinstance(value, np.ndarray) else value
        if not is_number(number):
            raise TypeError
        return int(number) if whole and number == int(number) else float(number)

    return Kind(allowed.words, allowed.several, fits, convert)


def one_of(*options: Any) -> Kind:
    """Kind of a text among some, where type checkers need not know which."""
    listed = "one of " + ", ".join(map(str, options))
    words = listed if len(options) > 3 else " or ".join(map(str, options))
    return Kind(words, words, lambda value: isinstance(value, str) and value in options)


def _word(annotation: Any, _: str) -> Kind:
    return one_of(*get_args(annotation))


def _object(annotation: Any, _: str) -> Kind:
    name = annotation.__name__
    word = f"an object of {name}"
    one, several = CLASSES.get(name, (word, f"objects of {name}"))
    if getattr(annotation, "_is_protocol", False):
        methods = [each for each in vars(annotation) if not each.startswith("_")]
        return Kind(one, several, lambda value: all(hasattr(value, each) for each in methods))
    if issubclass(annotation, Enum):
        one = several = " or ".join(each.value for each in annotation)
    return Kind(one, several, lambda value: isinstance(value, annotation), holds=frozenset([name]))


def _array(annotation: Any, _: str) -> Kind:
    dims = annotation.dim_str.split()
    fixed = sum(not each.startswith(("*", "...")) for each in dims)
    most = fixed if fixed == len(dims) else np.inf
    numeric = "biu" if "int" in str(annotation.dtypes) else "iuf"
    if all("bool" in each for each in annotation.dtypes):
        numeric = "b"

    def fits(value: Any) -> bool:
        if not isinstance(value, np.ndarray) or value.dtype.kind not in numeric:
            return False
        return fixed <= value.ndim <= most and bool(np.isfinite(value).all())

    words = f"an array of finite numbers ({', '.join(dims)})"
    return Kind(words, "arrays of numbers", fits, lambda value: as_array(value, numeric))


def as_array(value: Any, numeric: str = "iuf") -> np.ndarray:
    """Array of numbers; texts, complex numbers and truth values are none.

    Raises `TypeError` or `ValueError` for anything else, and lists of unlike lengths.
    """
    if isinstance(value, str | Mapping):
        raise TypeError
    array = np.asarray(value)
    if array.dtype.kind not in numeric or array.dtype.kind == "b" != numeric:
        raise TypeError
    mixed = array is not value and array.dtype.kind != "b"
    if mixed and any(isinstance(each, bool) for each in np.asarray(value, object).ravel()):
        raise TypeError
    return array.astype(float) if "f" in numeric else array


def _numbers(_: Any, __: str) -> Kind:
    """Kind of an array of any shape."""

    def fits(value: Any) -> bool:
        numeric = isinstance(value, np.ndarray) and value.dtype.kind in "iuf"
        return numeric and bool(np.isfinite(value).all())

    return Kind("an array of finite numbers", "arrays of finite numbers", fits)


def _row(annotation: Any, name: str) -> Kind:
    """Kind of a tuple of unlike things."""
    kinds = [kind_of(each, name) for each in get_args(annotation)]

    def fits(value: Any) -> bool:
        if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != len(kinds):
            return False
        return all(kind.fits(each) for kind, each in zip(kinds, value, strict=True))

    words = ", ".join(kind.words for kind in kinds)
    holds = frozenset[str]().union(*(kind.holds for kind in kinds))
    return Kind(f"a tuple ({words})", f"tuples ({words})", fits, holds=holds)


def _sequence(annotation: Any, name: str) -> Kind:
    arguments = get_args(annotation)
    fixed = len(arguments) if get_origin(annotation) is tuple and ... not in arguments else None
    entry = kind_of(arguments[0], name) if arguments else ANYTHING

    def fits(value: Any) -> bool:
        if not is_listed(value) or (fixed is not None and len(value) != fixed):
            return False
        return all(map(entry.fits, value))

    def culprit(value: Any) -> str:
        wrong = (each for each in value if not entry.fits(each)) if is_listed(value) else iter(())
        return next(map(entry.refused, wrong), short(value))

    number = "a list of" if fixed is None else f"{fixed}"
    words = f"{number} {entry.several}"
    return Kind(words, f"lists of {entry.several}", fits, culprit=culprit, holds=entry.holds)


def _iterable(annotation: Any, name: str) -> Kind:
    """Kind of what is gone through once: a list is made of it, and checked as one."""

    def convert(value: Any) -> Any:
        if isinstance(value, str | bytes | Mapping):
            raise TypeError
        return list(value)

    return replace(_sequence(annotation, name), convert=convert)


def _mapping(annotation: Any, name: str) -> Kind:
    keys, values = (kind_of(each, name) for each in get_args(annotation) or (Any, Any))
    by = "descriptor" if "Descriptor" in keys.holds else "name"
    example = "{rod.max_curvature: 6.0}" if by == "descriptor" else '{"q": 2.5}'

    def fits(value: Any) -> bool:
        return (
            is_mapping(value)
            and all(map(keys.fits, value))
            and all(map(values.fits, value.values()))
        )

    def culprit(value: Any) -> str:
        if not isinstance(value, Mapping):
            return short(value)
        strange = [key for key in value if not keys.fits(key)]
        if strange:
            return f"the key {short(strange[0])}"
        wrong = [key for key, each in value.items() if not values.fits(each)]
        label, inside = getattr(wrong[0], "name", wrong[0]), value[wrong[0]]
        joint = "." if isinstance(inside, Mapping) and inside else " = "
        return f"{label}{joint}{values.refused(inside)}"

    def convert(value: Any) -> Any:
        if not is_mapping(value):
            raise TypeError
        fitting = {key: each for key, each in value.items() if values.fits(each)}
        return {k: fitting[k] if k in fitting else convert_value(values, value[k]) for k in value}

    numeric = by == "name" and values.fits(0.5)
    plain = values.several if values.words != ANYTHING.words else "values"
    example = f", like `{example}`" if values.fits(0.5) else ""
    words = f"{plain} by {by}{example}"
    return Kind(
        words,
        f"{plain} by {by}",
        fits,
        convert,
        culprit,
        holds=keys.holds | values.holds,
        by_name=numeric,
    )


def _function(_: Any, __: str) -> Kind:
    return Kind("a function", "functions", callable)


def _either(kinds: Sequence[Kind]) -> Kind:
    """Kind of what has one of several kinds; None is allowed without being said."""
    said = [kind for kind in kinds if kind is not NOTHING]
    words = list(dict.fromkeys(kind.words for kind in said))
    several = list(dict.fromkeys(kind.several for kind in said))

    def fits(value: Any) -> bool:
        return any(kind.fits(value) for kind in kinds)

    def convert(value: Any) -> Any:
        for kind in said:
            try:
                made = convert_value(kind, value)
            except (TypeError, ValueError, OverflowError):
                continue
            return made
        raise TypeError

    def culprit(value: Any) -> str:
        parts = (kind.refused(value) for kind in said)
        return next((part for part in parts if part != short(value)), short(value))

    holds = frozenset[str]().union(*(kind.holds for kind in kinds))
    by_name = any(kind.by_name for kind in said)
    return Kind(" or ".join(words), " or ".join(several), fits, convert, culprit, holds, by_name)


def convert_value(kind: Kind, value: Any) -> Any:
    """Value in a form that fits; TypeError or ValueError if there is none."""
    made = kind.convert(value) if kind.convert is not None else value
    if not kind.fits(made):
        raise TypeError
    return made


def _is(*wanted: Any) -> Callable[[Any, Any], bool]:
    return lambda annotation, origin: annotation in wanted or origin in wanted


Make = Callable[[Any, str], Kind]


def _always(kind: Kind) -> Make:
    return lambda _annotation, _name: kind


def _is_class(annotation: Any, origin: Any) -> bool:
    return origin is None and isinstance(annotation, type) and annotation is not object


MAKERS: tuple[tuple[Callable[[Any, Any], bool], Make], ...] = (
    (lambda annotation, _: annotation in (None, types.NoneType), _always(NOTHING)),
    (_is(bool), _always(TRUTH)),
    (_is(float, int), number_kind),
    (_is(str), _always(TEXT)),
    (_is(Path), _object),
    (_is(Literal), _word),
    (lambda annotation, _: hasattr(annotation, "dim_str"), _array),
    (_is(Any), _always(ANYTHING)),
    (_is(np.ndarray), _numbers),
    (
        lambda annotation, origin: (
            origin is tuple
            and len(set(get_args(annotation))) > 1
            and ... not in get_args(annotation)
        ),
        _row,
    ),
    (_is(Sequence, tuple, list), _sequence),
    (_is(Mapping, dict), _mapping),
    (_is(Iterable), _iterable),
    (_is(Callable), _function),
    (_is_class, _object),
)
"""How kinds are made, by the first test of an annotation and its origin that applies."""
