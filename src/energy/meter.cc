#include "energy/meter.h"

#include <algorithm>
#include <cmath>

#include "base/try.h"
#include "base/units.h"

namespace joulecast::energy {
namespace {

// The accounts that error control watches. Every term of the model enters the modelled power; the others
// change where a power, the motion or the turn changes its sign.
constexpr std::array watched{
    account::battery,  account::modelled, account::drawn,
    account::distance, account::turned,   account::ledger + static_cast<std::size_t>(signals::Term::braking)};
constexpr std::size_t heat_index = watched.size();
constexpr std::size_t state_size = heat_index + 2;

// The same channels that may be unknown, and the same payload.
bool have_the_same(const dynamics::Instant& a, const dynamics::Instant& b) {
  const auto known = [](const dynamics::Instant& at) {
    return std::array{std::isnan(at.x_m), std::isnan(at.y_m), std::isnan(at.heading_rad),
                      std::isnan(at.climb_rad)};
  };
  return a.payload_kg == b.payload_kg && known(a) == known(b);
}

}  // namespace

std::array<double, 2> fitted_acceleration(std::span<const SpeedSample> window, std::size_t at) {
  const std::size_t n = window.size();
  if (n < 2) return {};
  const double origin = window[at].t_s;
  double s1 = 0, s2 = 0, s3 = 0, s4 = 0;
  std::array<double, 2> y0{}, y1{}, y2{};
  for (const SpeedSample& sample : window) {
    const double t = sample.t_s - origin, tt = t * t;
    s1 += t;
    s2 += tt;
    s3 += tt * t;
    s4 += tt * tt;
    for (std::size_t side : {0u, 1u}) {
      // Differences from the centre keep the sums small.
      const double w = sample.speed_rad_s[side] - window[at].speed_rad_s[side];
      y0[side] += w;
      y1[side] += w * t;
      y2[side] += w * tt;
    }
  }
  const double count = static_cast<double>(n);
  const bool two_sided = at > 0 && at + 1 < n;
  std::array<double, 2> slope{};
  if (!two_sided) {
    const double spread = count * s2 - s1 * s1;
    for (std::size_t side : {0u, 1u})
      slope[side] = spread > 0 ? (count * y1[side] - s1 * y0[side]) / spread : 0;
    return slope;
  }
  // Cramer's rule on the normal equations of a + b t + c t^2; only b, the slope at the centre, is wanted.
  const double determinant =
      count * (s2 * s4 - s3 * s3) - s1 * (s1 * s4 - s3 * s2) + s2 * (s1 * s3 - s2 * s2);
  for (std::size_t side : {0u, 1u}) {
    const double numerator = count * (y1[side] * s4 - s3 * y2[side]) - y0[side] * (s1 * s4 - s3 * s2) +
                             s2 * (s1 * y2[side] - y1[side] * s2);
    slope[side] = numerator / determinant;
  }
  return slope;
}

// One settled sample, with the rates of the accounts there.
struct Meter::Node {
  std::int64_t utime_us = 0;
  Reading reading;
  Coverage coverage;
  Rates rates{};
  std::array<double, 2> copper_w{};

  void evaluate(const dynamics::DriveModel& model) { rates = rates_at(model, reading, coverage, copper_w); }
};

// The initial value problem between two samples, in time since the first of them.
class Meter::Segment final : public InitialValueProblem {
 public:
  Segment(const dynamics::DriveModel& model, double tolerance)
      : model_(model), tolerance_(tolerance), erk_(state_size, account::count, *this) {}

  // Integrates from `a` to `b`, evaluated with one coverage; `copper_heat_w` goes in at `a` and comes out at
  // `b`. Returns the accounts' increments.
  Result<Rates> integrate(const Node& a, const Node& b, double interval_s,
                          std::array<double, 2>& copper_heat_w) {
    a_ = &a;
    b_ = &b;
    interval_s_ = interval_s;
    double power_scale = std::max(model_.parameters().idle_power_w, 1.0);
    for (const Node* end : {&a, &b}) {
      for (const std::size_t k : {account::modelled, account::battery})
        power_scale = std::max(power_scale, std::fabs(end->rates[k]));
    }
    weight_ = 1 / (tolerance_ * power_scale * interval_s);
    const std::span<double> y = erk_.state();
    std::ranges::fill(y, 0.0);
    std::ranges::copy(copper_heat_w, y.begin() + heat_index);
    TRY(erk_.advance(0, interval_s));
    Rates increment;
    std::ranges::copy(erk_.integrals(), increment.begin());
    std::copy_n(y.begin() + heat_index, 2, copper_heat_w.begin());
    return increment;
  }

  void rate(double t, std::span<const double> state, std::span<double> out) override {
    // At the ends the rates are given, except for the heat that the windings absorb in between.
    if (t == 0) return write(*a_, state, out);
    if (t == interval_s_ && model_.parameters().thermal_resistance_k_w == 0) return write(*b_, state, out);
    now_.reading = between(a_->reading, b_->reading, t / interval_s_);
    now_.reading.motion.copper_heat_w = {state[heat_index], state[heat_index + 1]};
    now_.coverage = b_->coverage;
    now_.evaluate(model_);
    write(now_, state, out);
  }

  void weights(std::span<const double> state, std::span<double> weight) const override {
    std::ranges::fill(weight, weight_);
    for (std::size_t s : {heat_index, heat_index + 1})  // 1 W of low-passed copper heat, or a share of much
      weight[s] = 1 / (1 + tolerance_ * std::fabs(state[s]));
  }

 private:
  void write(const Node& node, std::span<const double> state, std::span<double> out) const {
    for (std::size_t k = 0; k < watched.size(); ++k) out[k] = node.rates[watched[k]];
    std::ranges::copy(node.rates, out.begin() + state_size);
    for (std::size_t s : {0u, 1u})
      out[heat_index + s] =
          (node.copper_w[s] - state[heat_index + s]) / model_.parameters().thermal_time_constant_s;
  }

  const dynamics::DriveModel& model_;
  double tolerance_;
  const Node* a_ = nullptr;
  const Node* b_ = nullptr;
  Node now_;
  double interval_s_ = 0;
  double weight_ = 1;
  Erk erk_;
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
                 seconds_per_microsecond >
             reach_s();
}

Result<void> Meter::add(const signals::Sample& sample, double climb_rad, bool bridged) {
  if (!waiting_.empty() && bridged) {
    const double interval_s =
        static_cast<double>(sample.utime_us - waiting_.back().sample.utime_us) * seconds_per_microsecond;
    // A missing sample is not the robot's rate.
    if (usual_interval_s_ == 0) {
      usual_interval_s_ = interval_s;
    } else {
      usual_interval_s_ += (std::min(interval_s, 2 * usual_interval_s_) - usual_interval_s_) / 16;
    }
  }
  waiting_.push_back({sample, climb_rad, bridged});
  Result<void> outcome;
  while (next_ < waiting_.size() && window_complete(next_))
    if (Result<void> settled = settle(next_++); !settled) outcome = settled;
  // Removes history older than the window of the next sample to settle, except the neighbour before it.
  const auto keep_from = static_cast<double>(waiting_[std::min(next_, waiting_.size() - 1)].sample.utime_us) -
                         reach_s() / seconds_per_microsecond;
  while (next_ > 1 && static_cast<double>(waiting_.front().sample.utime_us) < keep_from) {
    waiting_.pop_front();
    --next_;
  }
  return outcome;
}

Result<void> Meter::flush() {
  Result<void> outcome;
  while (next_ < waiting_.size())
    if (Result<void> settled = settle(next_++); !settled) outcome = settled;
  return outcome;
}

// The filter's window: samples within reach of waiting_[index] and its neighbours, not across a gap. Returns
// the place of waiting_[index] in it.
std::size_t Meter::fill_window(std::size_t index) {
  const double reach_us = reach_s() / seconds_per_microsecond;
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
  for (std::size_t k = first; k <= last; ++k)
    window_.push_back({span_us(index, k) * seconds_per_microsecond, waiting_[k].sample.wheel_velocity_rad_s});
  return index - first;
}

Result<void> Meter::integrate_to(const Node& node, double interval_s) {
  Node from = *last_, to = node;
  if (from.coverage != to.coverage || !have_the_same(from.reading.motion, to.reading.motion)) {
    // A channel that only one end has would enter with a jump.
    from.coverage = to.coverage = {from.coverage.battery && to.coverage.battery,
                                   from.coverage.motors && to.coverage.motors};
    from.reading = between(last_->reading, node.reading, 0);
    to.reading = between(last_->reading, node.reading, 1);
    from.evaluate(model_);
    to.evaluate(model_);
  }
  const Result<Rates> integrated = segment_->integrate(from, to, interval_s, copper_heat_w_);
  Rates increment;
  if (integrated)
    increment = *integrated;
  else
    std::ranges::transform(from.rates, to.rates, increment.begin(),
                           [&](double a, double b) { return 0.5 * interval_s * (a + b); });
  if (!std::ranges::all_of(increment, [](double value) { return std::isfinite(value); })) {
    // No motor reaches this heat: its readings are impossible.
    copper_heat_w_ = {};
    skip_gap(interval_s);
    return fail(Fault::invalid, "model", "the power of the recorded motion is not finite");
  }
  book(increment, accounts_);
  if (to.coverage.battery) accounts_.measured_s += interval_s;
  if (to.coverage.motors) accounts_.motor_measured_s += interval_s;
  accounts_.duration_s += interval_s;
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
  const dynamics::Body<double> body =
      dynamics::body_of_wheels(model_.parameters(), node.reading.motion.wheel_speed_rad_s,
                               node.reading.motion.wheel_acceleration_rad_s2);
  point.t_s = static_cast<double>(point.sample.utime_us - origin_utime_us_) * seconds_per_microsecond;
  point.speed_m_s = body.speed_m_s;
  point.yaw_rate_rad_s = body.yaw_rate_rad_s;
  point.measured_power_w = node.coverage.battery ? node.rates[account::measured] : signals::unmeasured;
  point.modelled_power_w = node.rates[account::modelled];
  const double resistance_k_w = model_.parameters().thermal_resistance_k_w;
  for (std::size_t s : {0u, 1u}) {
    point.winding_temperature_c[s] = point.sample.motor_temperature_c[s];
    if (std::isnan(point.winding_temperature_c[s]) && resistance_k_w > 0)
      point.winding_temperature_c[s] = settings_.winding_reference_c + resistance_k_w * copper_heat_w_[s];
  }
}

void Meter::keep_last(const Node& node) {
  if (last_ == nullptr)
    last_ = std::make_unique<Node>(node);
  else
    *last_ = node;
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
  node.evaluate(model_);
  if (counted_utime_us_ && sample.utime_us <= *counted_utime_us_) {
    keep_last(node);
    origin_utime_us_ = sample.utime_us;
    return {};
  }
  counted_utime_us_.reset();

  Result<void> outcome;
  if (last_ == nullptr) {
    origin_utime_us_ = sample.utime_us;
  } else {
    point.interval_s = static_cast<double>(sample.utime_us - last_->utime_us) * seconds_per_microsecond;
    point.bridged = waiting_[index].bridged;
    if (point.bridged)
      outcome = integrate_to(node, point.interval_s);
    else
      skip_gap(point.interval_s);
  }
  node.reading.motion.copper_heat_w = copper_heat_w_;
  if (model_.parameters().thermal_resistance_k_w > 0) node.evaluate(model_);
  describe_state(node, point);
  keep_last(node);
  emit_(point);
  return outcome;
}

}  // namespace joulecast::energy
