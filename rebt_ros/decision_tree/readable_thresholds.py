import math

MARGIN = 0.2
DIG = 2


def _in(lo, hi, mid, kmin_digits):
    top = max(abs(lo), abs(hi))
    if top == 0:
        return 0.0
    e = math.floor(math.log10(top)) + 1
    for k in range(e, e - kmin_digits - 1, -1):
        p = float(f"1e{k}")
        if p == 0:
            break
        a = math.floor(lo / p) - 1
        b = math.ceil(hi / p) + 1
        # candidates near mid first
        c = round(mid / p) if math.isfinite(mid / p) else 0
        best = None
        cand = sorted({a, a + 1, a + 2, b, b - 1, b - 2, c - 1, c, c + 1})
        for m in cand:
            v = float(f"{m}e{k}")
            if lo <= v < hi and (best is None or abs(v - mid) < abs(best - mid)):
                best = v
        if best is not None:
            return best + 0.0
    return None


def roundest(lo, hi):
    if not math.isfinite(hi):
        hi = lo + max(abs(lo), 1.0)
    w = hi - lo
    mid = lo + w / 2
    if MARGIN > 0:
        v = _in(lo + MARGIN * w, hi - MARGIN * w, mid, DIG - 1 + 1)
        if (
            v is not None
            and lo <= v < hi
            and len(f"{abs(v):.15g}".replace(".", "").strip("0").split("e")[0].strip("0")) <= DIG
        ):
            return v
    v = _in(lo, hi, mid, 18)
    return lo if v is None else v


def shared_thresholds(gaps):
    order = sorted(range(len(gaps)), key=lambda i: gaps[i][1])
    out = [0.0] * len(gaps)
    i = 0
    todo = order[:]
    while todo:
        lo = -math.inf
        hi = gaps[todo[0]][1]
        grp = []
        rest = []
        for j in todo:
            (grp if gaps[j][0] < hi else rest).append(j)
        lo = max(gaps[j][0] for j in grp)
        v = roundest(lo, hi)
        for j in grp:
            out[j] = v
        todo = rest
    return out
