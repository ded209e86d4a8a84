#include "gap/groups/contrast.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

namespace joulecast::gap {
namespace {

using statistics::Information;

constexpr double shared = 0.3;  // of the mean power, that each thing that groups share may move
constexpr double ordinary_part =
    0.5;  // of what a robot may be off its file: what groups may differ by all the same

Eigen::VectorXd share_of(std::span<const std::size_t> group_of_block, std::size_t groups) {
  Eigen::VectorXd share = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(groups));
  for (const std::size_t g : group_of_block)
    share[static_cast<Eigen::Index>(g)] += 1 / static_cast<double>(group_of_block.size());
  return share;
}

// The columns of which each group has its own, and how much more of them a block of a group has than the
// mean.
struct Layout {
  std::vector<Eigen::Index> own;
  Eigen::Index base = 0;
  std::size_t groups = 0;
  Eigen::VectorXd share;

  Eigen::Index size() const { return base + static_cast<Eigen::Index>(own.size() * (groups - 1)); }
  Eigen::Index place(std::size_t group, std::size_t k) const {  // group from 1
    return base + static_cast<Eigen::Index>((group - 1) * own.size() + k);
  }
  double factor(std::size_t block_group, std::size_t group) const {
    return (block_group == group ? 1 : 0) - share[static_cast<Eigen::Index>(group)];
  }

  Information expanded(const Information& i, std::size_t group) const {
    const auto q = static_cast<Eigen::Index>(own.size());
    Information e(size());
    e.yy = i.yy;
    e.log_scale = i.log_scale;
    e.xx.topLeftCorner(base, base) = i.xx;
    e.xy.head(base) = i.xy;
    const Eigen::MatrixXd beside = i.xx(Eigen::all, own), within = i.xx(own, own);
    const Eigen::VectorXd answers = i.xy(own);
    for (std::size_t a = 1; a < groups; ++a) {
      const double fa = factor(group, a);
      e.xx.block(0, place(a, 0), base, q) = fa * beside;
      e.xx.block(place(a, 0), 0, q, base) = fa * beside.transpose();
      e.xy.segment(place(a, 0), q) = fa * answers;
      for (std::size_t b = 1; b < groups; ++b)
        e.xx.block(place(a, 0), place(b, 0), q, q) = fa * factor(group, b) * within;
    }
    return e;
  }
};

Eigen::MatrixXd by_group(const Eigen::VectorXd& differences, const Eigen::VectorXd& share) {
  const Eigen::Index groups = share.size(), own = differences.size() / (groups - 1);
  Eigen::MatrixXd strengths = Eigen::MatrixXd::Zero(groups, own);
  for (Eigen::Index g = 1; g < groups; ++g)
    strengths.row(g) = differences.segment((g - 1) * own, own).transpose();
  return strengths.rowwise() - (share.transpose() * strengths).eval().row(0);
}

}  // namespace

Eigen::MatrixXd by_group(const Eigen::VectorXd& differences, std::span<const std::size_t> group_of_block,
                         std::size_t groups) {
  return by_group(differences, share_of(group_of_block, groups));
}

Problem contrast(const Problem& base, std::span<const std::size_t> group_of_block, std::size_t groups) {
  Layout layout;
  layout.base = base.plain.tolerance.size();
  layout.groups = groups;
  layout.share = share_of(group_of_block, groups);
  std::vector<std::size_t> place(static_cast<std::size_t>(layout.base), 0);
  Eigen::VectorXd wide = Eigen::VectorXd::Zero(layout.base);
  for (const Hypothesis& h : base.hypotheses) {
    const auto& columns = h.candidate.columns;
    for (std::size_t k = 0; k < columns.size(); ++k) {
      const auto at = static_cast<Eigen::Index>(columns[k]);
      if (std::ranges::find(layout.own, at) != layout.own.end()) continue;
      place[columns[k]] = layout.own.size();
      layout.own.push_back(at);
      const double unit = base.moved(
          h, Eigen::VectorXd::Unit(static_cast<Eigen::Index>(columns.size()), static_cast<Eigen::Index>(k)));
      // What moves no power at all is not let go further than it is expected to be.
      wide[at] = unit > 0 ? std::min(shared / unit, 10 * h.candidate.expected) : h.candidate.expected;
    }
  }
  Problem problem;
  for (Hypothesis h : base.hypotheses) {
    const std::vector<std::size_t> own = h.candidate.columns;
    h.candidate.columns.clear();
    for (std::size_t g = 1; g < groups; ++g) {
      for (const std::size_t k : own)
        h.candidate.columns.push_back(static_cast<std::size_t>(layout.place(g, place[k])));
    }
    h.candidate.least = -std::numeric_limits<double>::infinity();
    h.candidate.most = std::numeric_limits<double>::infinity();
    problem.hypotheses.push_back(std::move(h));
  }
  const auto expand = [&](const Circumstances& now, double part) {
    Circumstances c = now;
    c.tolerance = Eigen::VectorXd::Zero(layout.size());
    c.tolerance.head(layout.base) = (now.tolerance.array().square() + wide.array().square()).sqrt();
    for (std::size_t g = 1; g < groups; ++g) {
      for (std::size_t k = 0; k < layout.own.size(); ++k)
        c.tolerance[layout.place(g, k)] = part * now.tolerance[layout.own[k]];
    }
    return c;
  };
  for (const Circumstances& c : base.circumstances) problem.circumstances.push_back(expand(c, ordinary_part));
  problem.plain = expand(base.plain, 0);
  for (const auto& blocks : base.blocks) {
    problem.blocks.emplace_back();
    for (std::size_t b = 0; b < blocks.size(); ++b)
      problem.blocks.back().push_back(layout.expanded(blocks[b], group_of_block[b]));
  }
  const auto kept = std::make_shared<const Problem>(
      Problem{base.hypotheses, {}, {}, {}, base.moved, base.cancelling, base.likeness});
  // Any hypothesis of the base that is the same one has its columns.
  const auto in_base = [kept](const Hypothesis& h) -> const Hypothesis& {
    return *std::ranges::find_if(kept->hypotheses, [&](const Hypothesis& o) {
      return o.id() == h.id() && o.effect.values == h.effect.values && o.parameter == h.parameter &&
             o.effect.effect == h.effect.effect;
    });
  };
  problem.likeness = [kept, in_base](const Hypothesis& a, const Hypothesis& b) {
    return kept->likeness(in_base(a), in_base(b));
  };
  problem.moved = [kept, in_base, share = layout.share](const Hypothesis& h, const Eigen::VectorXd& c) {
    const Eigen::MatrixXd strengths = by_group(c, share);
    double moved = 0;
    for (Eigen::Index g = 0; g < share.size(); ++g)
      moved += share[g] * kept->moved(in_base(h), strengths.row(g).transpose());
    return moved;
  };
  problem.cancelling = [kept, share = layout.share](const HypothesisSet& set, const Eigen::VectorXd& c) {
    double most = 1;
    for (Eigen::Index g = 0; g < share.size(); ++g) {
      Eigen::VectorXd own(c.size() / (share.size() - 1));
      Eigen::Index from = 0, to = 0;
      for (const std::size_t h : set) {
        const auto n = static_cast<Eigen::Index>(kept->hypotheses[h].candidate.columns.size());
        own.segment(to, n) = by_group(c.segment(from, n * (share.size() - 1)), share).row(g).transpose();
        from += n * (share.size() - 1);
        to += n;
      }
      most = std::max(most, kept->cancelling(set, own));
    }
    return most;
  };
  return problem;
}

void take_out(Problem& problem, const HypothesisSet& set, const Eigen::VectorXd& coefficients,
              const std::vector<bool>& which) {
  Eigen::VectorXd all = Eigen::VectorXd::Zero(problem.plain.tolerance.size());
  Eigen::Index at = 0;
  for (const std::size_t h : set) {
    for (const std::size_t k : problem.hypotheses[h].candidate.columns)
      all[static_cast<Eigen::Index>(k)] = coefficients[at++];
  }
  for (auto& blocks : problem.blocks) {
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      if (!which[b]) continue;
      Information& block = blocks[b];
      const Eigen::VectorXd explained = block.xx * all;
      block.yy += all.dot(explained - 2 * block.xy);
      block.xy -= explained;
    }
  }
}

}  // namespace joulecast::gap
