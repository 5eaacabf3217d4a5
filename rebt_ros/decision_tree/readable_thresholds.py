def shared_thresholds(gaps):
    out = []
    for lo, hi in gaps:
        out.append((lo + hi) / 2 if hi < 1e300 else lo)
    return out
