#include "tests/study/corrections/corrections.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "gap/verdict/words.h"
#include "statistics/bootstrap.h"
#include "tests/study/corrections/witnesses.h"

namespace joulecast::gap {
namespace corrections {
namespace {

using Set = std::vector<std::size_t>;  // indices of hypotheses, ascending

constexpr std::size_t most_errors = 3, most_extended = 3, most_refined = 12, most_kept = 60;
constexpr double least_odds = -3;  // log odds over the fit in hand below which an error is not fitted
constexpr double least_gain = 2;   // nats that a further error must gain
constexpr double near_best = 6;    // nats
constexpr int first_steps = 4, more_steps = 10;
constexpr int bags = 32;
constexpr double claimed = 0.5, contradicted_at = 0.9;
constexpr double sure_factor = 0.75;  // probability from which on readings are corrected, not left out
constexpr double agree = 0.2;         // difference of logarithms of factors
constexpr double least_scale = 1.25;  // of a factor; nearer to 1 it is left to the effects
constexpr double least_delay_s = 0.5;

// The maximum under one set of errors.
struct Tried {
  Maximum maximum;
  std::vector<Error> errors;
  double log_evidence = 0, log_prior = 0, limits = 0;
};

class Competition {
 public:
  Competition(Witnesses& witnesses, std::vector<Hypothesis> all, bool prune)
      : witnesses_(witnesses), all_(std::move(all)), prune_(prune) {}

  void run();
  CorrectedReadings answer(const telemetry::RecordingSet& recordings, const robot::RobotModel& robot);

 private:
  Tried fit(const Set& set, int steps, const Tried* start);
  double most_gain(const Hypothesis& h, const Tried& from) const;
  void bag();
  double probability(const Hypothesis& h, double factor) const;
  double contradicted(const Hypothesis& h) const;
  std::string causes(const Hypothesis& h, double factor) const;

  Witnesses& witnesses_;
  std::vector<Hypothesis> all_;
  bool prune_;
  std::size_t fitted_ = 0;
  std::map<Set, Tried> tried_;
  std::vector<const Tried*> kept_;
  std::vector<double> posterior_;
};

double factor_of(const Error& e) {
  return e.what->factor_at(e.value);
}

Tried Competition::fit(const Set& set, int steps, const Tried* start) {
  ++fitted_;
  Tried out;
  for (const std::size_t k : set) {
    Error error{&all_[k], 0};
    out.log_prior += all_[k].log_prior;
    if (all_[k].free()) {
      error.value = witnesses_.start_of(all_[k]);
      if (start != nullptr) {
        const auto same = std::ranges::find(start->errors, error.what, &Error::what);
        if (same != start->errors.end()) error.value = same->value;
      }
    }
    out.errors.push_back(error);
  }
  Problem problem;
  problem.unknowns = witnesses_.unknowns();
  const std::size_t physical = problem.unknowns.size();
  for (const Error& e : out.errors) {
    if (!e.what->free()) continue;
    const bool offset = e.what->kind == Kind::offset;
    const double sd = !offset ? 1.5 : e.what->of == Quantity::yaw_rate ? 0.1 : witnesses_.offset_deviation();
    problem.unknowns.push_back({sd, 1e9, false, false});
  }
  problem.rescaling = problem.unknowns.size() - physical;
  problem.independent = witnesses_.independent();
  problem.fewest = witnesses_.fewest();
  const auto set_free = [&](const Eigen::VectorXd& x) {
    auto at = static_cast<Eigen::Index>(physical);
    for (Error& e : out.errors) {
      if (e.what->free()) e.value = x[at++];
    }
  };
  problem.compare = [&](const Eigen::VectorXd& x, Comparison& c) {
    set_free(x);
    witnesses_.compare(out.errors, x, c);
  };
  Eigen::VectorXd x = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(problem.unknowns.size()));
  if (start != nullptr)
    x.head(static_cast<Eigen::Index>(physical)) = start->maximum.at.head(static_cast<Eigen::Index>(physical));
  auto at = static_cast<Eigen::Index>(physical);
  for (const Error& e : out.errors) {
    if (e.what->free()) x[at++] = e.value;
  }
  out.maximum = maximise(problem, x, steps);
  set_free(out.maximum.at);
  out.limits = witnesses_.limits(out.errors);
  out.log_evidence = out.maximum.log_evidence + out.log_prior + out.limits;
  return out;
}

// Whether an error of this quantity moves the residual of a witness.
bool reaches(const Hypothesis& h, std::size_t witness) {
  const auto w = static_cast<Witness>(witness);
  const bool voltage = w <= Witness::voltage_left, current = !voltage && w <= Witness::current_left;
  switch (h.of) {
    case Quantity::wheel_velocity:
      return w != Witness::battery_voltage;
    case Quantity::motor_voltage:
      return voltage || w == Witness::power;
    case Quantity::motor_current:
      return voltage || current || w == Witness::power;
    case Quantity::battery_voltage:
    case Quantity::battery_current:
    case Quantity::battery_power:
      return w == Witness::power || w == Witness::battery_voltage;
    case Quantity::yaw_rate:
      return w == Witness::gyro;
    case Quantity::position:
      return w == Witness::travel;
    case Quantity::heading:
      return w == Witness::travel || w == Witness::turn;
    case Quantity::pitch:
      return current || voltage || w == Witness::power;
  }
  return true;
}

// An upper bound of what an error adds to the log evidence of a fit: no witness in its reach has a residual,
// and neither the parameters nor the limits cost anything.
double Competition::most_gain(const Hypothesis& h, const Tried& from) const {
  double gain = h.log_prior + from.maximum.minus_log_prior - from.limits;
  for (std::size_t w = 0; w < witness_count; ++w) {
    if (!reaches(h, w)) continue;
    const double n = witnesses_.independent()[w];
    gain += surprise(n, from.maximum.relative[w]) - surprise(n, 0);
  }
  return gain;
}

void Competition::run() {
  tried_[{}] = fit({}, first_steps + more_steps, nullptr);
  std::vector<Set> front{{}};
  for (std::size_t depth = 0; depth < most_errors && !front.empty(); ++depth) {
    std::vector<std::pair<Set, Tried>> found;
    for (const Set& base : front) {
      const Tried& from = tried_.at(base);
      for (std::size_t k = 0; k < all_.size(); ++k) {
        const bool excluded =
            std::ranges::any_of(base, [&](std::size_t b) { return all_[b].excludes(all_[k]); });
        if (excluded || (depth > 0 && all_[k].kind == Kind::offset)) continue;
        if (prune_ && most_gain(all_[k], from) < (depth == 0 ? least_odds : least_gain)) continue;
        Set set = base;
        set.insert(std::ranges::upper_bound(set, k), k);
        if (tried_.contains(set) || std::ranges::any_of(found, [&](auto& f) { return f.first == set; }))
          continue;
        Tried best = fit(set, first_steps, &from);
        if (depth == 0) {
          Tried other = fit(set, first_steps, nullptr);
          if (other.log_evidence > best.log_evidence) best = std::move(other);
        }
        found.emplace_back(std::move(set), std::move(best));
      }
    }
    std::ranges::sort(found, std::greater{}, [](const auto& f) { return f.second.log_evidence; });
    const auto best_of_all = [&] {
      double best = -std::numeric_limits<double>::infinity();
      for (const auto& [set, t] : tried_) best = std::max(best, t.log_evidence);
      return best;
    };
    const double before = best_of_all();
    for (std::size_t k = 0; k < std::min(found.size(), most_kept); ++k) {
      auto& [set, t] = found[k];
      if (k < most_refined) {
        Tried more = fit(set, more_steps, &t);
        if (more.log_evidence > t.log_evidence) t = std::move(more);
      }
      tried_[set] = std::move(t);
    }
    const double best = best_of_all();
    if (best < before + least_gain) break;
    front.clear();
    for (std::size_t k = 0; k < std::min(found.size(), most_extended); ++k) {
      const Set& set = found[k].first;
      if (tried_.at(set).log_evidence > std::max(before + least_gain, best - near_best)) front.push_back(set);
    }
  }
  bag();
}

// The posterior, averaged over resamples of the blocks at the maxima of all of them.
void Competition::bag() {
  for (const auto& [set, t] : tried_) kept_.push_back(&t);
  std::ranges::sort(kept_, std::greater{}, &Tried::log_evidence);
  if (kept_.size() > most_kept) kept_.resize(most_kept);
  if (std::ranges::find(kept_, &tried_.at({})) == kept_.end()) kept_.push_back(&tried_.at({}));
  // Sums of each block, by witness.
  struct Sums {
    std::vector<std::array<double, 3>> block;  // |residual|, reading^2, rows
  };
  std::map<std::size_t, std::size_t> index;
  std::vector<std::vector<std::size_t>> block_of;
  for (const Tried* t : kept_) {
    block_of.push_back(witnesses_.blocks(t->errors));
    for (const std::size_t b : block_of.back()) index.emplace(b, 0);
  }
  std::size_t blocks = 0;
  for (auto& [b, at] : index) at = blocks++;
  std::vector<std::array<Sums, witness_count>> sums(kept_.size());
  for (std::size_t k = 0; k < kept_.size(); ++k) {
    const Comparison& c = kept_[k]->maximum.comparison;
    for (std::size_t w = 0; w < witness_count; ++w) {
      sums[k][w].block.resize(blocks);
      for (Eigen::Index r = 0; r < c.residual.rows(); ++r) {
        const double e = c.residual(r, static_cast<Eigen::Index>(w)),
                     y = c.reading(r, static_cast<Eigen::Index>(w));
        if (!std::isfinite(e + y)) continue;
        auto& sum = sums[k][w].block[index.at(block_of[k][static_cast<std::size_t>(r)])];
        sum[0] += std::fabs(e);
        sum[1] += y * y;
        sum[2] += 1;
      }
    }
  }
  posterior_.assign(kept_.size(), 0);
  for (const std::vector<int>& draw : statistics::bootstrap_counts(blocks, bags)) {
    std::vector<double> log_evidence(kept_.size());
    for (std::size_t k = 0; k < kept_.size(); ++k) {
      const Tried& t = *kept_[k];
      log_evidence[k] = t.log_prior + t.limits - t.maximum.minus_log_prior - t.maximum.half_log_determinant;
      for (std::size_t w = 0; w < witness_count; ++w) {
        std::array<double, 3> sum{};
        double rows = 0;
        for (std::size_t b = 0; b < blocks; ++b) {
          for (std::size_t i = 0; i < 3; ++i) sum[i] += draw[b] * sums[k][w].block[b][i];
          rows += sums[k][w].block[b][2];
        }
        const double fewest = rows < witnesses_.fewest()[w] ? std::numeric_limits<double>::infinity() : 0;
        log_evidence[k] -=
            surprise(witnesses_.independent()[w], relative_residual(sum[0], sum[1], sum[2], fewest));
      }
    }
    const double best = std::ranges::max(log_evidence);
    double total = 0;
    for (double& l : log_evidence) total += l = std::exp(l - best);
    for (std::size_t k = 0; k < kept_.size(); ++k) posterior_[k] += log_evidence[k] / total / bags;
  }
}

double Competition::probability(const Hypothesis& h, double factor) const {
  double sum = 0;
  for (std::size_t k = 0; k < kept_.size(); ++k) {
    const bool same = std::ranges::any_of(kept_[k]->errors, [&](const Error& e) {
      const bool alike = h.kind == Kind::delay || factor_of(e) / factor > 0;
      return e.what->channel() == h.channel() && e.what->kind == h.kind && alike &&
             std::fabs(std::log(factor_of(e) / factor)) < agree;
    });
    if (same) sum += posterior_[k];
  }
  return sum;
}

double Competition::contradicted(const Hypothesis& h) const {
  double sum = 0;
  for (std::size_t k = 0; k < kept_.size(); ++k) {
    if (std::ranges::any_of(kept_[k]->errors, [&](const Error& e) { return e.what->excludes(h); }))
      sum += posterior_[k];
  }
  return sum;
}

// The likely causes of a factor: those of all hypotheses that agree with it.
std::string Competition::causes(const Hypothesis& h, double factor) const {
  std::vector<std::string> all;
  if (!h.cause.empty()) all.push_back(h.cause);
  for (const Hypothesis& other : all_) {
    const bool alike = other.channel() == h.channel() && h.kind == Kind::scale && other.kind == h.kind &&
                       std::fabs(std::log(other.factor / factor)) < agree;
    if (alike && !other.cause.empty() && other.cause != h.cause) all.push_back(other.cause);
  }
  if (all.empty()) return "in another scale";
  return fmt::format("{}", fmt::join(all, " or "));
}

std::string subject_of(const Hypothesis& h) {
  const bool one = h.side[0] != h.side[1];
  const std::string side = !one ? "" : h.side[0] ? "right " : "left ";
  const auto of_motor = [&](const char* what) {
    return one ? fmt::format("The {}motor's {} is", side, what) : fmt::format("The motors' {}s are", what);
  };
  switch (h.of) {
    case Quantity::wheel_velocity:
      return one ? fmt::format("The speed of the {}wheel is", side) : "The wheel speeds are";
    case Quantity::motor_voltage:
      return of_motor("voltage");
    case Quantity::motor_current:
      return of_motor("current");
    case Quantity::battery_voltage:
      return "The battery's voltage is";
    case Quantity::battery_current:
      return "The battery's current is";
    case Quantity::battery_power:
      return "The battery's voltage and current are";
    case Quantity::yaw_rate:
      return "The yaw rate is";
    case Quantity::position:
      return "The position is";
    case Quantity::heading:
      return "The heading is";
    case Quantity::pitch:
      return "The pitch is";
  }
  return "";
}

std::string sentence_of(const Hypothesis& h, const ReadingCorrection& c, const std::string& causes) {
  std::string text = subject_of(h) + " recorded ";
  switch (h.kind) {
    case Kind::scale:
      text += fmt::format("{}: readings are {:.3g} times the truth",
                          h.cause.empty() ? "in another scale" : h.cause, c.factor);
      break;
    case Kind::delay:
      text += fmt::format("{:.2g} s late", h.delay_s);
      break;
    default:
      text += causes;
  }
  text += fmt::format(" (probability {}).", probability_text(c.probability));
  if (h.kind == Kind::delay) return text;
  if (c.applied) return text + " The diagnosis uses corrected readings.";
  return text + (c.left_out ? " The diagnosis leaves these readings out."
                            : " The diagnosis uses the readings as recorded.");
}

CorrectedReadings Competition::answer(const telemetry::RecordingSet& recordings,
                                      const robot::RobotModel& robot) {
  CorrectedReadings out;
  out.hypotheses = all_.size();
  out.fitted = fitted_;
  const auto likeliest = static_cast<std::size_t>(std::ranges::max_element(posterior_) - posterior_.begin());
  const Tried& best = *kept_[likeliest];
  std::vector<Error> corrected, left_out;
  for (std::size_t k = 0, free = 0; k < best.errors.size(); ++k) {
    const Error& error = best.errors[k];
    const Hypothesis& h = *error.what;
    ReadingCorrection c;
    c.channel = h.channel();
    c.kind = name_of(h.kind);
    c.factor = factor_of(error);
    c.delay_s = h.delay_s;
    c.deviation = std::numeric_limits<double>::quiet_NaN();
    if (h.free()) {
      const auto at = static_cast<Eigen::Index>(witnesses_.unknowns().size() + free++);
      c.deviation = best.maximum.deviation[at] * c.factor;
    }
    c.probability = probability(h, c.factor);
    c.contradicted = contradicted(h);
    // Small factors, offsets and short delays are effects of their own.
    const bool effect = h.kind == Kind::offset || (h.kind == Kind::delay && h.delay_s < least_delay_s) ||
                        (h.kind == Kind::scale && std::fabs(std::log(c.factor)) < std::log(least_scale));
    if (c.probability < claimed || effect) continue;
    if (c.contradicted >= contradicted_at && h.kind != Kind::delay) {
      c.applied = c.probability >= sure_factor && h.kind != Kind::supply;
      c.left_out = !c.applied;
      (c.applied ? corrected : left_out).push_back(error);
    }
    c.says = sentence_of(h, c, causes(h, c.factor));
    out.found.push_back(std::move(c));
  }
  if (corrected.empty() && left_out.empty()) return out;
  out.recordings = recordings;
  for (std::size_t m = 0; m < recordings.missions.size(); ++m) {
    telemetry::Recording& mission = out.recordings->missions[m];
    for (const Error& e : left_out) leave_out(*e.what, mission);
    for (const Error& e : corrected) {
      std::vector<std::uint8_t> returned;
      if (e.what->of == Quantity::battery_current && e.what->kind == Kind::rectified)
        returned = witnesses_.returned(best.errors, best.maximum.at, m);
      remove_error(*e.what, e.value, robot, returned, mission);
    }
  }
  return out;
}

}  // namespace
}  // namespace corrections

CorrectedReadings correct_readings(const telemetry::RecordingSet& recordings, const robot::RobotModel& robot,
                                   bool prune) {
  corrections::Witnesses witnesses(recordings, robot);
  if (!witnesses.usable()) return {};
  corrections::Competition competition(witnesses, corrections::hypotheses_for(robot, witnesses.measured()),
                                       prune);
  competition.run();
  return competition.answer(recordings, robot);
}

}  // namespace joulecast::gap
