#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "battery/circuit.h"

namespace joulecast::battery {

// Trust in model and sensors. Shares of the nominal voltage or of the capacity, so that cells and packs are
// treated alike.
struct ChargeTrust {
  double open_circuit_sd =
      0.003;  // of the nominal voltage: error of the curve and of the circuit's slow part
  double default_curve_sd = 0.015;   // the same where the robot file has no curve
  double correlation_charge = 0.08;  // charge drawn over which that error stays the same ...
  double correlation_s = 12 * 3600;  // ... and time
  double voltage_noise = 0.0005;     // of the nominal voltage, of one averaged reading
  double drop_sd = 0.1;              // of the voltage dropped inside the battery, uncorrelated
  double curve_shift_sd = 0.01;   // of the charge by which the curve is displaced; counts where it is steep
  double default_shift_sd = 0.1;  // the same where the file has no curve: the same error all along
  double resistance_sd = 0.15;    // of the file's resistance, constant for hours
  double default_resistance_sd = 0.4;   // the same where the file has a single resistance
  double bias_per_h = 0.01;             // of the capacity an hour: offset of the current sensor
  double gain_sd = 0.02;                // of current or capacity, over correlation_charge
  double modelled_current_sd = 0.15;    // of a current that was not measured but follows from the model
  double modelled_current_s = 600;      // over which that error stays the same
  double unknown_current_per_h = 0.25;  // of the capacity an hour: possible flow while nothing is measured
  double unknown_charge_sd = 0.3;
};

// State of charge by a Kalman filter on the circuit of the robot file. States: charge, the currents of both
// branches, both charge lags, offset of the current sensor [A], logarithm of the resistance's factor, and a
// slowly drifting error of the open-circuit voltage [V], without which the voltage would have too much
// weight. Everything but the open-circuit curve is linear. The curve is linearised statistically over the
// charge's own uncertainty, and again over the uncertainty that the voltage leaves (iterated posterior
// linearisation, Garcia-Fernandez et al. 2015). A start that is wrong by half the capacity thus converges at
// the first voltage where the curve is steep, and a flat curve does not reduce the uncertainty.
//
// A voltage that contradicts the charge for some successive updates (a pack was exchanged, the stored charge
// was wrong) makes the filter start over from the voltage.
class ChargeFilter {
 public:
  static constexpr int size = 8;
  using Vector = Eigen::Matrix<double, size, 1>;
  using Matrix = Eigen::Matrix<double, size, size>;  // symmetric

  explicit ChargeFilter(const robot::Battery& battery);

  // Makes the charge unknown.
  void forget();
  // Takes a charge from another source, e.g. full at the end of charging.
  void observe_charge(double charge, double sd);

  // Advances over a time of constant current, by the sensor. `current_sd_a` is the standard deviation of the
  // current, constant over modelled_current_s; zero for a measured current.
  void advance(double current_a, double duration_s, double current_sd_a = 0);
  // Corrects by the voltage at the end of it, while `current_a` (by the sensor) flows. `more_noise_v` adds to
  // the trust's noise.
  void correct(double voltage_v, double current_a, double more_noise_v = 0);
  // Advances over a time in which nothing was measured: the current is unknown.
  void gap(double duration_s);

  void set_temperature_c(double temperature_c) { temperature_c_ = temperature_c; }

  bool known() const { return known_; }  // a voltage or an observation came since it was forgotten
  double charge() const;                 // 0 to 1, of the present capacity
  double charge_sd() const;
  double current_bias_a() const;
  double current_bias_sd_a() const;
  // The standard deviation of the charge by one voltage alone; large on a flat curve.
  double voltage_only_sd() const;
  std::size_t restarts() const { return restarts_; }  // times that the voltage contradicted the charge
  const Circuit& circuit() const { return circuit_; }

  // State to be restored after a restart.
  struct Memory {
    Vector mean = Vector::Zero();
    Matrix covariance = Matrix::Zero();
    bool known = false;
  };
  Memory memory() const { return {x_, p_, known_}; }
  // False, without a change, when the memory is invalid (not finite, variance not positive).
  bool recall(const Memory& memory);

 private:
  bool revises_first(double& voltage_v, double current_a);
  struct Linear {
    double mean_v;       // expected voltage
    Vector h;            // its derivatives
    double variance_v2;  // of the nonlinear part
  };
  State state() const;
  void begin(double current_a);
  double charge_at(double voltage_v, double current_a) const;
  Linear linearise(const Vector& x, const Matrix& p, double current_a) const;
  double drop_v(const State& state, double current_a, double resistance_factor) const;

  Circuit circuit_;
  static constexpr ChargeTrust trust_{};
  double nominal_voltage_v_;
  double curve_sd_v_;
  double shift_sd_;
  bool shift_stays_;
  std::vector<double> first_v_;  // readings without their drop
  double begun_v_ = 0;           // the one that the estimate began with; NaN after a restart
  double resistance_sd_;
  double bias_sd_a_;
  double temperature_c_ = reference_temperature_c;
  Vector x_;  // mean
  Matrix p_;  // covariance
  bool known_ = false;
  int contradictions_ = 0;  // in succession, of one sign
  std::size_t restarts_ = 0;
};

// One robot's battery at one instant; NaN: not measured.
struct ChargeReading {
  std::int64_t utime_us = 0;
  double voltage_v = std::numeric_limits<double>::quiet_NaN();
  double current_a = std::numeric_limits<double>::quiet_NaN();
  double modelled_power_w =
      std::numeric_limits<double>::quiet_NaN();  // used where the current is not measured
};

// The present source of the charge.
enum class ChargeSource { unknown, voltage_and_current, voltage_and_model, current, model };
std::string_view name(ChargeSource source);

struct ChargeEstimate {
  double charge = std::numeric_limits<double>::quiet_NaN();
  double sd = std::numeric_limits<double>::quiet_NaN();
  ChargeSource source = ChargeSource::unknown;
  bool default_curve = false;  // the robot file has no open-circuit curve: a typical one is used
  bool flat_curve = false;     // here the voltage barely depends on the charge: it is only counted
  double current_bias_a = 0;
  double current_bias_sd_a = std::numeric_limits<double>::quiet_NaN();
};

// Why the voltage determines the charge poorly, as a sentence; empty where it does not.
std::string limitation_of(const ChargeEstimate& estimate);

// The charge filter over time: takes a robot's readings as they arrive, averages them, and bridges missing
// ones (current by the model's power, voltage by counting, silence by a larger deviation). Depends only on
// the readings' clock.
class ChargeTracker {
 public:
  ChargeTracker(const robot::Battery& battery, double idle_power_w);

  // Readings in order of time.
  void add(const ChargeReading& reading);
  // Call when the clock was set: the time between the last reading and the next is unknown.
  void interrupt() { last_.reset(); }
  // Call when the charger has ended: the battery is full.
  void observe_full();

  const ChargeEstimate& estimate() const { return estimate_; }
  const ChargeFilter& filter() const { return filter_; }

  struct Memory {
    ChargeFilter::Memory filter;
    std::int64_t utime_us = 0;  // of the last reading in it
  };
  std::optional<Memory> memory() const;  // absent before the first reading
  // To be called before the first reading. False when the memory is invalid.
  bool recall(const Memory& memory);

 private:
  void update();
  void refresh();

  ChargeFilter filter_;
  double idle_power_w_;
  bool default_curve_;
  ChargeSource source_ = ChargeSource::unknown;
  ChargeEstimate estimate_;
  std::optional<ChargeReading> last_;
  std::int64_t counted_utime_us_ = 0;  // up to which the filter has come
  // Sums since then.
  double duration_s_ = 0, charge_as_ = 0, modelled_as_ = 0, voltage_vs_ = 0, voltage_s_ = 0;
};

}  // namespace joulecast::battery
