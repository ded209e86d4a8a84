#pragma once

#include <span>
#include <vector>

#include "gap/diagnose/problem.h"

namespace joulecast::gap {

// From a problem its comparison between groups of blocks: of each hypothesis, that its strength is another
// one from group to group. What all groups share may be anything and is integrated out, so that only
// differences decide. The coefficients of a hypothesis are those of each group but the first, beside the
// first's, group by group. Each block is of one group, and each group has a block.
Problem contrast(const Problem& base, std::span<const std::size_t> group_of_block, std::size_t groups);

// The base hypothesis' coefficients in every group, each beside the mean over all blocks: groups by
// coefficients.
Eigen::MatrixXd by_group(const Eigen::VectorXd& differences, std::span<const std::size_t> group_of_block,
                         std::size_t groups);

// Takes what these hypotheses explain out of the response of these blocks.
void take_out(Problem& problem, const HypothesisSet& set, const Eigen::VectorXd& coefficients,
              const std::vector<bool>& blocks);

}  // namespace joulecast::gap
