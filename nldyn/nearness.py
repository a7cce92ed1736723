"""When an eigenvalue is so near to the excitation that there is no steady response to speak of."""

from __future__ import annotations

# |λ - iω| below this share of ω makes an eigenvalue λ near: a steady response is at most 1/NEAR
# times as large as what the excitation brings about in 1/ω, and so are its rounding errors; in the
# derivative by ω they are up to 1/NEAR² times as large
NEAR = 3e-3
