"""Several flights of one aircraft: one joint estimate, and the comparison of two configurations (docs/pooling.md)."""

from analysis.pooling.comparison import Comparison, compare, flights_to_see
from analysis.pooling.pooled_results import PooledResult, pool_results

__all__ = ["Comparison", "PooledResult", "compare", "flights_to_see", "pool_results"]
