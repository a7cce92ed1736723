"""Test functions of multipliers, compiled."""

from __future__ import annotations

import math

import numpy as np

from nldyn.flow.kernels.compiling import inner, njit

NEAR_CIRCLE = 0.4  # distance from the unit circle, within which a multiplier may cross it soon
LEAST_MODULUS = 1e-3  # that has a logarithm here: far inside


@njit(cache=True, error_model="numpy")
def flip_test(multipliers):
    """∏(μ + 1), each factor divided by 1 + |μ|: changes sign where a multiplier crosses -1."""
    return shifted_product(multipliers, 1.0)


@njit(cache=True, error_model="numpy")
def branch_point_test(multipliers):
    """∏(μ - 1), each factor divided by 1 + |μ|: changes sign where a multiplier crosses +1."""
    return shifted_product(multipliers, -1.0)


@inner
def shifted_product(multipliers, shift):
    """∏(μ + shift) / (1 + |μ|)."""
    product = 1.0 + 0.0j
    for mu in multipliers:
        product *= (mu + shift) / (1.0 + abs(mu))
    return product.real


@njit(cache=True, error_model="numpy")
def torus_test(multipliers):
    """∏(μᵢμⱼ - 1) over pairs i < j, scaled: zero where a pair is on the unit circle.

    The product is the determinant of the bialternate product of Φ with itself minus the identity
    (Kuznetsov 2004, section 10.2.2).
    """
    product = 1.0 + 0.0j
    for i in range(multipliers.size):
        for j in range(i):
            both = multipliers[i] * multipliers[j]
            product *= (both - 1.0) / (1.0 + abs(both))
    return product.real


@njit(cache=True, error_model="numpy")
def nearest_pair(multipliers):
    """Index of the first of the two whose product is nearest to 1, and how far that is from 1."""
    index, least = 0, np.inf
    for i in range(multipliers.size):
        for j in range(i + 1, multipliers.size):
            off = abs(multipliers[i] * multipliers[j] - 1.0)
            if off < least:
                index, least = i, off
    return index, least


@njit(cache=True, error_model="numpy")
def travel(before, after):
    """Longest way of a multiplier near the unit circle to the nearest one of the next orbit."""
    longest = 0.0
    for mu in before:
        if abs(math.log(max(abs(mu), LEAST_MODULUS))) < NEAR_CIRCLE:
            shortest = np.inf
            for other in after:
                shortest = min(shortest, abs(other - mu))
            longest = max(longest, shortest)
    return longest


@njit(cache=True, error_model="numpy")
def number_outside(multipliers, tolerance):
    """Fewest and most multipliers outside the unit circle, if each modulus may be off so far."""
    fewest, most = 0, 0
    for mu in multipliers:
        fewest += abs(mu) > 1.0 + tolerance
        most += abs(mu) > 1.0 - tolerance
    return fewest, most
