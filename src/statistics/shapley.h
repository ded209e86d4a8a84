#pragma once

#include <cstddef>
#include <functional>
#include <vector>

namespace joulecast::statistics {

// Shapley values of n players: how much each, on average over the orders of adding them, takes off `gap`, over the
// gap without any (Shapley, A Value for n-Person Games, 1953). `gap` is called once for each of the 2^n subsets with
// the indices of its members in order; it is in any unit and not negative. All are 0 where no gap is to be shared.
std::vector<double> shapley_shares(std::size_t n,
                                   const std::function<double(const std::vector<std::size_t>&)>& gap);

}  // namespace joulecast::statistics
