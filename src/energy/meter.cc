#include "energy/meter.h"

#include <algorithm>
#include <cmath>

#include "energy/rates.h"

namespace joulecast::energy {
namespace {

constexpr std::size_t heat_index = account::count;
constexpr std::size_t state_size = heat_index + 2;
constexpr double seconds_per_hour = 3600;
constexpr double microseconds = 1e-6;

}  // namespace

// One settled sample.
struct Meter::Node {
  std::int64_t utime_us = 0;
  Reading reading;
  Coverage coverage;
};

// The initial value problem between two samples, in time since the first of them.
class Meter::Segment final : public InitialValueProblem {
 public:
  Segment(const dynamics::DriveModel& model, double tolerance)
      : model_(model), tolerance_(tolerance), cvode_(state_size, Method::adams, *this) {}

  // Integrates from `a` to `b`; `copper_heat_w` goes in at `a` and comes out at `b`. Returns the accounts'
  // increments.
  Result<Rates> integrate(const Reading& a, const Reading& b, Coverage coverage, double interval_s,
                          std::array<double, 2>& copper_heat_w) {
    a_ = a;
    b_ = b;
    coverage_ = coverage;
    interval_s_ = interval_s;
    std::array<double, 2> copper{};
    start_ = rates_at(model_, a, coverage, copper);
    end_ = rates_at(model_, b, coverage, copper);
    const double power_scale =
        std::max({std::fabs(start_[account::modelled]), std::fabs(end_[account::modelled]),
                  std::fabs(start_[account::battery]), std::fabs(end_[account::battery]),
                  model_.parameters().idle_power_w, 1.0});
    weight_ = 1 / (tolerance_ * power_scale * interval_s);
    const std::span<double> y = cvode_.state();
    std::ranges::fill(y, 0.0);
    for (std::size_t s : {0u, 1u}) y[heat_index + s] = copper_heat_w[s];
    // A first step of half the interval: the departure from the chord is zero at both ends and largest near
    // the middle, so there CVODE's error test sees it, and shortens the step where it is not small.
    const Result<void> done = cvode_.advance(0, interval_s, 0.5 * interval_s);
    Rates increment;
    for (std::size_t k = 0; k < account::count; ++k) {
      const double departure = done ? y[k] : 0;
      increment[k] = 0.5 * interval_s * (start_[k] + end_[k]) + departure;
    }
    if (!done) return tl::unexpected(done.error());
    for (std::size_t s : {0u, 1u}) copper_heat_w[s] = y[heat_index + s];
    return increment;
  }

  Rates chord() const {
    Rates increment;
    for (std::size_t k = 0; k < account::count; ++k) increment[k] = 0.5 * interval_s_ * (start_[k] + end_[k]);
    return increment;
  }

  void rate(double t, std::span<const double> state, std::span<double> out) override {
    const double s = t / interval_s_;
    Reading reading = between(a_, b_, s);
    reading.motion.copper_heat_w = {state[heat_index], state[heat_index + 1]};
    std::array<double, 2> copper{};
    const Rates now = rates_at(model_, reading, coverage_, copper);
    for (std::size_t k = 0; k < account::count; ++k)
      out[k] = now[k] - (start_[k] + s * (end_[k] - start_[k]));
    for (std::size_t k : {0u, 1u})
      out[heat_index + k] = (copper[k] - state[heat_index + k]) / model_.parameters().thermal_time_constant_s;
  }

  void weights(std::span<const double>, std::span<double> weight) const override {
    std::ranges::fill(weight, weight_);
    for (std::size_t s : {0u, 1u}) weight[heat_index + s] = 1;  // 1 W of low-passed copper heat
  }

 private:
  const dynamics::DriveModel& model_;
  double tolerance_;
  Reading a_, b_;
  Coverage coverage_;
  double interval_s_ = 0;
  Rates start_{}, end_{};
  double weight_ = 1;
  Cvode cvode_;
};

Meter::Meter(dynamics::DriveModel model, MeterSettings settings, std::function<void(const MeterPoint&)> emit)
    : model_(std::move(model)),
      settings_(settings),
      emit_(std::move(emit)),
      segment_(std::make_unique<Segment>(model_, settings.tolerance)) {}

Meter::~Meter() = default;

void Meter::interrupt() {
  waiting_.clear();
  next_ = 0;
  usual_interval_s_ = 0;
  last_.reset();
  counted_utime_us_.reset();
}

void Meter::resume(const signals::Accounts& accounts, std::int64_t counted_utime_us,
                   const std::array<double, 2>& winding_temperature_c) {
  accounts_ = accounts;
  counted_utime_us_ = counted_utime_us;
  const double resistance_k_w = model_.parameters().thermal_resistance_k_w;
  for (std::size_t s : {0u, 1u})
    if (std::isfinite(winding_temperature_c[s]) && resistance_k_w > 0)
      copper_heat_w_[s] = (winding_temperature_c[s] - settings_.winding_reference_c) / resistance_k_w;
}

void Meter::begin() {
  interrupt();
  payload_kg_ = 0;
  accounts_ = {};
  gaps_ = 0;
  gap_seconds_ = 0;
}

bool Meter::window_complete(std::size_t index) const {
  const std::size_t later = waiting_.size() - 1 - index;
  if (later == 0) return false;
  const double usual = std::max(1.0, std::round(settings_.half_window_s / usual_interval_s_));
  return static_cast<double>(later) >= usual ||
         static_cast<double>(waiting_.back().sample.utime_us - waiting_[index].sample.utime_us) *
                 microseconds >
             reach_s();
}

Result<void> Meter::add(const signals::Sample& sample, double climb_rad, bool bridged) {
  if (!waiting_.empty() && bridged) {
    const double interval_s =
        static_cast<double>(sample.utime_us - waiting_.back().sample.utime_us) * microseconds;
    // A missing sample is not the robot's rate.
    if (usual_interval_s_ == 0) {
      usual_interval_s_ = interval_s;
    } else {
      usual_interval_s_ += (std::min(interval_s, 2 * usual_interval_s_) - usual_interval_s_) / 16;
    }
  }
  waiting_.push_back({sample, climb_rad, bridged});
  Result<void> outcome;
  while (next_ < waiting_.size() && window_complete(next_)) {
    if (Result<void> settled = settle(next_++); !settled) outcome = settled;
  }
  // Done with: history older than the window of the next sample to settle, but for the neighbour before it.
  const auto keep_from = static_cast<double>(waiting_[std::min(next_, waiting_.size() - 1)].sample.utime_us) -
                         reach_s() / microseconds;
  while (next_ > 1 && static_cast<double>(waiting_.front().sample.utime_us) < keep_from) {
    waiting_.pop_front();
    --next_;
  }
  return outcome;
}

Result<void> Meter::flush() {
  Result<void> outcome;
  while (next_ < waiting_.size()) {
    if (Result<void> settled = settle(next_++); !settled) outcome = settled;
  }
  return outcome;
}

// The filter's window: samples within reach of waiting_[index] and its neighbours, not across a gap. Returns
// the place of waiting_[index] in it.
std::size_t Meter::fill_window(std::size_t index) {
  const double reach_us = reach_s() / microseconds;
  const auto span_us = [&](std::size_t from, std::size_t to) {
    return static_cast<double>(waiting_[to].sample.utime_us - waiting_[from].sample.utime_us);
  };
  std::size_t first = index, last = index;
  while (first > 0 && (first == index || span_us(first - 1, index) <= reach_us) && waiting_[first].bridged)
    --first;
  while (last + 1 < waiting_.size() && (last == index || span_us(index, last + 1) <= reach_us) &&
         waiting_[last + 1].bridged)
    ++last;
  window_.clear();
  for (std::size_t k = first; k <= last; ++k) {
    window_.push_back({span_us(index, k) * microseconds, waiting_[k].sample.wheel_velocity_rad_s});
  }
  return index - first;
}

void Meter::book(const Rates& increment, Coverage coverage, double interval_s) {
  accounts_.battery_j += increment[account::battery];
  accounts_.measured_j += increment[account::measured];
  if (coverage.battery) accounts_.measured_s += interval_s;
  if (coverage.motors) accounts_.motor_measured_s += interval_s;
  accounts_.modelled_j += increment[account::modelled];
  for (std::size_t s : {0u, 1u}) {
    accounts_.measured_motor_j[s] += increment[account::measured_motor + s];
    accounts_.modelled_motor_j[s] += increment[account::modelled_motor + s];
  }
  accounts_.drawn_j += increment[account::drawn];
  accounts_.returned_j += increment[account::returned];
  accounts_.charge_ah += increment[account::charge_a] / seconds_per_hour;
  accounts_.distance_m += increment[account::distance];
  accounts_.turned_rad += increment[account::turned];
  accounts_.duration_s += interval_s;
  for (std::size_t k = 0; k < signals::term_count; ++k)
    accounts_.ledger.value[k] += increment[account::ledger + k];
}

Result<void> Meter::integrate_to(const Node& node, double interval_s) {
  const Coverage both{node.coverage.battery && last_->coverage.battery,
                      node.coverage.motors && last_->coverage.motors};
  Reading from = last_->reading;
  from.motion.copper_heat_w = copper_heat_w_;
  Reading to = node.reading;
  // Known at one end only, the climb would enter with a jump.
  if (std::isnan(from.motion.climb_rad) || std::isnan(to.motion.climb_rad))
    from.motion.climb_rad = to.motion.climb_rad = dynamics::unknown;
  const Result<Rates> integrated = segment_->integrate(from, to, both, interval_s, copper_heat_w_);
  book(integrated ? *integrated : segment_->chord(), both, interval_s);
  if (!integrated) return tl::unexpected(integrated.error());
  return {};
}

void Meter::skip_gap(double interval_s) {
  ++gaps_;
  gap_seconds_ += interval_s;
  // Without readings, the windings are taken to cool without current.
  const double decay = std::exp(-interval_s / model_.parameters().thermal_time_constant_s);
  for (double& heat : copper_heat_w_) heat *= decay;
}

void Meter::describe_state(const Node& node, MeterPoint& point) const {
  std::array<double, 2> copper{};
  const Rates now = rates_at(model_, node.reading, node.coverage, copper);
  const dynamics::Body<double> body =
      dynamics::body_of_wheels(model_.parameters(), node.reading.motion.wheel_speed_rad_s,
                               node.reading.motion.wheel_acceleration_rad_s2);
  point.t_s = static_cast<double>(point.sample.utime_us - origin_utime_us_) * microseconds;
  point.speed_m_s = body.speed_m_s;
  point.yaw_rate_rad_s = body.yaw_rate_rad_s;
  point.measured_power_w = node.coverage.battery ? now[account::measured] : signals::unmeasured;
  point.modelled_power_w = now[account::modelled];
  for (std::size_t s : {0u, 1u}) {
    point.winding_temperature_c[s] =
        std::isfinite(point.sample.motor_temperature_c[s])
            ? point.sample.motor_temperature_c[s]
            : settings_.winding_reference_c + model_.parameters().thermal_resistance_k_w * copper_heat_w_[s];
  }
}

Result<void> Meter::settle(std::size_t index) {
  const signals::Sample& sample = waiting_[index].sample;
  const std::size_t place = fill_window(index);
  if (std::isfinite(sample.payload_kg)) payload_kg_ = sample.payload_kg;

  MeterPoint point;
  point.sample = sample;
  point.climb_rad = waiting_[index].climb_rad;
  point.wheel_acceleration_rad_s2 = fitted_acceleration(window_, place);
  Node node{sample.utime_us,
            reading_of(sample, point.wheel_acceleration_rad_s2, payload_kg_, point.climb_rad, copper_heat_w_),
            {std::isfinite(sample.battery_voltage_v) && std::isfinite(sample.battery_current_a),
             std::isfinite(sample.motor_voltage_v[0]) && std::isfinite(sample.motor_voltage_v[1]) &&
                 std::isfinite(sample.motor_current_a[0]) && std::isfinite(sample.motor_current_a[1])}};

  if (counted_utime_us_ && sample.utime_us <= *counted_utime_us_) {
    last_ = std::make_unique<Node>(node);
    origin_utime_us_ = sample.utime_us;
    return {};
  }
  counted_utime_us_.reset();

  Result<void> outcome;
  if (last_ == nullptr) {
    origin_utime_us_ = sample.utime_us;
  } else {
    point.interval_s = static_cast<double>(sample.utime_us - last_->utime_us) * microseconds;
    point.bridged = waiting_[index].bridged;
    if (point.bridged)
      outcome = integrate_to(node, point.interval_s);
    else
      skip_gap(point.interval_s);
  }
  node.reading.motion.copper_heat_w = copper_heat_w_;
  describe_state(node, point);
  last_ = std::make_unique<Node>(node);
  emit_(point);
  return outcome;
}

}  // namespace joulecast::energy
