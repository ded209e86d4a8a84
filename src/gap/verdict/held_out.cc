#include "gap/verdict/held_out.h"

#include <algorithm>
#include <cmath>

namespace joulecast::gap {

void compare_blocks(std::span<const posterior::HeldOut::Block> blocks, std::size_t parts, Diagnosis& d) {
  using Block = posterior::HeldOut::Block;
  Baseline& b = *d.baseline;
  const auto better = b.held_out < b.unchanged_model_held_out ? &Block::regression : &Block::file;
  double sum = 0, squares = 0, size = 0;
  for (const Block& block : blocks) {
    const double apart = block.explanation - block.*better;
    sum += apart, squares += apart * apart, size += block.size;
  }
  b.deviation = std::sqrt(std::max(0.0, squares - sum * sum / static_cast<double>(blocks.size()))) / size;
  if (d.effects.empty()) return;
  Shrinkage& s = d.shrinkage.emplace();
  s.before = b.unchanged_model_held_out;
  s.after = b.explanation_held_out;
  s.fraction = 1 - s.after / s.before;
  s.interval = posterior::removed_interval(blocks);
  s.parts = parts;
}

}  // namespace joulecast::gap
