#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace joulecast::statistics {

inline constexpr int bootstrap_draws = 400;

// How often each of n blocks is drawn, for every draw (Efron and Tibshirani 1993, chapter 8): the same draws
// for the same n and seed, so that comparisons use the same draws.
std::vector<std::vector<int>> bootstrap_counts(std::size_t n, int draws = bootstrap_draws,
                                               std::uint64_t seed = 20240229);

// 95 % interval of a statistic of weighted blocks: quantiles of its values over the draws. Values that are
// not finite are left out; {NaN, NaN} where none is left, or of fewer than two blocks, which show no scatter.
std::array<double, 2> bootstrap_interval(std::size_t blocks,
                                         const std::function<double(std::span<const int>)>& statistic,
                                         int draws = bootstrap_draws);

}  // namespace joulecast::statistics
