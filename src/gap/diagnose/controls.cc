#include "gap/diagnose/controls.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>
#include <random>
#include <thread>

#include "gap/diagnose/naming.h"
#include "statistics/evidence.h"

namespace joulecast::gap {
namespace {

constexpr double control_block_s = 8;  // of leftovers that are kept together

// From which window each window takes its leftover: stretches of some seconds, each from a random place.
std::vector<std::size_t> shuffled(std::span<const Window> windows, std::mt19937_64& random) {
  std::vector<std::size_t> from(windows.size());
  // Windows on a regular grid and windows at single readings are not mixed.
  for (const bool reading : {false, true}) {
    std::vector<std::size_t> members;
    for (std::size_t k = 0; k < windows.size(); ++k) {
      if (windows[k].reading == reading) members.push_back(k);
    }
    if (members.empty()) continue;
    std::uniform_int_distribution<std::size_t> pick(0, members.size() - 1);
    std::size_t source = 0;
    double left_s = 0;
    for (std::size_t n = 0; n < members.size(); ++n) {
      if (left_s <= 0) {
        source = pick(random);
        left_s = control_block_s;
      }
      from[members[n]] = members[source];
      const double step = n > 0 ? windows[members[n]].t_s - windows[members[n - 1]].t_s : 0;
      left_s -= step > 0 ? step : control_block_s;
      source = (source + 1) % members.size();
    }
  }
  return from;
}

// What an explanation says of every row, and what it leaves, in each channel's unit.
struct Told {
  std::array<Eigen::VectorXd, channel_count> fitted, left;
};

class Surrogates {
 public:
  Surrogates(const Material& m, const Linear& linear, const Problem& problem, const Explanation& explanation)
      : material_(m), linear_(linear), problem_(problem), explanation_(explanation) {
    statistics::Information total;
    for (const auto& block : problem.blocks[problem.plain.noise]) total += block;
    Eigen::VectorXd sd = problem.plain.tolerance;
    HypothesisSet all = explanation.whole;
    for (const Member& member : explanation.members) {
      if (member.candidate) all.push_back(member.hypothesis);
    }
    for (const std::size_t h : all) {
      const auto& c = problem.hypotheses[h].candidate;
      for (const std::size_t k : c.columns)
        sd[static_cast<Eigen::Index>(k)] = std::max(sd[static_cast<Eigen::Index>(k)], c.expected);
    }
    coefficients_ = statistics::ridge(total, sd).mean;
    for (std::size_t c = 0; c < channel_count; ++c) {
      const ChannelRows& r = linear.rows[c];
      if (r.y.size() == 0) continue;
      told_.fitted[c] = fitted(r, coefficients_);
      told_.fitted[c] += by_block(r, linear.noise[c], r.y - told_.fitted[c]);
      told_.left[c] = r.y - told_.fitted[c];
      row_of_[c].assign(m.windows.size(), -1);
      for (std::size_t k = 0; k < r.window.size(); ++k)
        row_of_[c][r.window[k]] = static_cast<Eigen::Index>(k);
    }
  }

  // Whether the member, or one of its group, is found in a surrogate without it.
  bool found(std::size_t member, std::uint64_t seed, const ExplainSettings& settings) const {
    const Member& m = explanation_.members[member];
    const Hypothesis& own = problem_.hypotheses[m.hypothesis];
    const Responses responses = response_without(own, seed);
    const Problem surrogate =
        make_problem(*linear_.columns, linear_.rows, linear_.noise, material_.blocks, &responses);
    const Explanation answer = explain(surrogate, {}, settings);
    return finds(answer, surrogate, stated_ids(problem_, m));
  }

 private:
  static Eigen::VectorXd fitted(const ChannelRows& r, const Eigen::VectorXd& coefficients) {
    Eigen::VectorXd local(static_cast<Eigen::Index>(r.columns.size()));
    for (std::size_t j = 0; j < r.columns.size(); ++j)
      local[static_cast<Eigen::Index>(j)] = coefficients[static_cast<Eigen::Index>(r.columns[j])];
    return r.x * local;
  }

  // What differs from block to block and is nothing else (a battery's level, a gyro's bias), as each block's
  // leftovers have it [channel's unit]. Shuffled among the leftovers it would be steps that no robot makes.
  Eigen::VectorXd by_block(const ChannelRows& r, const ChannelNoise& noise,
                           const Eigen::VectorXd& left) const {
    Eigen::VectorXd told = Eigen::VectorXd::Zero(left.size());
    std::vector<Eigen::Index> own;
    std::vector<double> scatter;
    for (std::size_t j = 0; j < r.columns.size(); ++j) {
      const Column& column = linear_.columns->columns()[r.columns[j]];
      if (column.tolerance > 0 || !(column.scatter > 0)) continue;
      own.push_back(static_cast<Eigen::Index>(j));
      scatter.push_back(column.scatter);
    }
    if (own.empty() || !(noise.sigma > 0)) return told;
    const Eigen::Map<const Eigen::VectorXd> sd(scatter.data(), static_cast<Eigen::Index>(scatter.size()));
    std::vector<std::vector<Eigen::Index>> rows(material_.blocks);
    for (std::size_t k = 0; k < r.block.size(); ++k) rows[r.block[k]].push_back(static_cast<Eigen::Index>(k));
    for (const std::vector<Eigen::Index>& block : rows) {
      if (block.empty()) continue;
      const Eigen::VectorXd weight =
          (noise.spread(block).array().square() * noise.inflation).max(1e-300).inverse();
      const Eigen::MatrixXd x = r.x(block, own) * sd.asDiagonal();
      Eigen::MatrixXd information = x.transpose() * weight.asDiagonal() * x;
      information.diagonal().array() += 1;
      told(block) = x * information.ldlt().solve(x.transpose() * weight.cwiseProduct(left(block)));
    }
    return told;
  }

  Responses response_without(const Hypothesis& own, std::uint64_t seed) const {
    std::mt19937_64 random(seed);
    const std::vector<std::size_t> from = shuffled(material_.windows, random);
    Eigen::VectorXd taken = Eigen::VectorXd::Zero(coefficients_.size());
    for (const std::size_t k : own.candidate.columns)
      taken[static_cast<Eigen::Index>(k)] = coefficients_[static_cast<Eigen::Index>(k)];
    Responses responses;
    for (std::size_t c = 0; c < channel_count; ++c) {
      const ChannelRows& r = linear_.rows[c];
      if (r.y.size() == 0 || !(linear_.noise[c].sigma > 0)) continue;
      const Eigen::VectorXd& spread = linear_.noise[c].spread;
      std::uniform_int_distribution<Eigen::Index> any(0, r.y.size() - 1);
      Eigen::VectorXd y = told_.fitted[c] - fitted(r, taken);
      for (Eigen::Index k = 0; k < y.size(); ++k) {
        Eigen::Index source = row_of_[c][from[r.window[static_cast<std::size_t>(k)]]];
        if (source < 0) source = any(random);  // where the channel did not speak
        y[k] += told_.left[c][source] / spread[source] * spread[k];
      }
      responses[c] = std::move(y);
    }
    return responses;
  }

  const Material& material_;
  const Linear& linear_;
  const Problem& problem_;
  const Explanation& explanation_;
  Eigen::VectorXd coefficients_;
  Told told_;
  std::array<std::vector<Eigen::Index>, channel_count> row_of_;
};

}  // namespace

std::optional<std::vector<Controls>> control(const Material& material, const Linear& linear,
                                             const Problem& problem, const Explanation& explanation,
                                             const ControlSettings& settings,
                                             const std::function<bool(double)>& goes_on) {
  const std::size_t members = explanation.members.size(), n = settings.surrogates;
  std::vector<Controls> controls(members, Controls{n, 0});
  if (members * n == 0) return controls;
  const Surrogates surrogates(material, linear, problem, explanation);
  // The more members that a large gap may have make a false name likelier by nothing, and cost most.
  ExplainSettings quick = settings.explain;
  quick.candidate = false;
  quick.most_members = std::min(quick.most_members, ExplainSettings{}.most_members);
  std::atomic<std::size_t> next = 0;
  std::atomic<bool> stopped = false;
  std::mutex mutex;
  std::size_t done = 0;
  const auto work = [&] {
    for (std::size_t k = next++; k < members * n && !stopped; k = next++) {
      const bool found = surrogates.found(k / n, k + 1, quick);
      const std::lock_guard lock(mutex);
      controls[k / n].named_in += found ? 1 : 0;
      if (!goes_on(static_cast<double>(++done) / static_cast<double>(members * n))) stopped = true;
    }
  };
  std::vector<std::jthread> others;
  for (std::size_t t = 1; t < settings.threads; ++t) others.emplace_back(work);
  work();
  others.clear();
  if (stopped) return std::nullopt;
  return controls;
}

}  // namespace joulecast::gap
