#pragma once

#include <span>

#include "gap/posterior/hold_out.h"
#include "gap/verdict/diagnosis.h"

namespace joulecast::gap {

// Sets the deviation of the diagnosis's baseline from its errors, and where effects were named the
// shrinkage but for its share of the noise floor. `parts`: held-out parts.
void compare_blocks(std::span<const posterior::HeldOut::Block> blocks, std::size_t parts,
                    Diagnosis& diagnosis);

}  // namespace joulecast::gap
