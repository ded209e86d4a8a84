#include <algorithm>

#include "windows/windows.h"

namespace joulecast::windows {
namespace {

constexpr std::size_t enough_missions = 8;  // to leave out whole ones
constexpr std::size_t most_blocks = 20;
constexpr double shortest_block_s = 15;  // shorter blocks share slow errors with their neighbours

}  // namespace

std::size_t assign_blocks(std::span<Window> windows, std::span<const double> mission_length_s) {
  double total_s = 0;
  for (const double length : mission_length_s) total_s += length;
  const double block_s = std::max(shortest_block_s, total_s / static_cast<double>(most_blocks));
  // Each mission is divided into equal segments; missions shorter than a block are joined with the next.
  std::vector<std::size_t> parts(mission_length_s.size(), 1), first(mission_length_s.size(), 0);
  std::size_t blocks = 0;
  double open_s = 0;  // of the block that short missions share
  for (std::size_t m = 0; m < mission_length_s.size(); ++m) {
    if (mission_length_s.size() < enough_missions)
      parts[m] = std::max<std::size_t>(1, static_cast<std::size_t>(mission_length_s[m] / block_s));
    const bool joins = m > 0 && parts[m] == 1 && parts[m - 1] == 1 && open_s > 0 &&
                       open_s + 0.5 * mission_length_s[m] < block_s;
    if (!joins) {
      first[m] = blocks;
      blocks += parts[m];
      open_s = 0;
    } else {
      first[m] = blocks - 1;
    }
    open_s += mission_length_s[m];
  }
  for (Window& w : windows) {
    const auto n = parts[w.mission];
    const double place = w.t_s / std::max(mission_length_s[w.mission], 1e-9) * static_cast<double>(n);
    w.block = first[w.mission] + std::min(n - 1, static_cast<std::size_t>(std::max(0.0, place)));
  }
  return blocks;
}

}  // namespace joulecast::windows
