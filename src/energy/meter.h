#pragma once

#include <array>
#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/error.h"
#include "dynamics/drive_model.h"
#include "energy/integrators.h"
#include "energy/rates.h"
#include "signals/gaps.h"
#include "signals/ledger.h"
#include "signals/sample.h"

namespace joulecast::energy {

// Angular acceleration of both wheels from their speeds: at each sample, the slope of the quadratic that fits
// the speeds around it best (least squares; times need not be equidistant). The window reaches half_window_s
// to each side and to the neighbouring samples at least, so that it scales with slow rates: with n samples at
// interval h on each side, n = max(1, round(half_window_s / h)).
//   Latency: n h, the filter looks that far ahead: 0.1 s from 10 to 200 Hz, one interval below.
//   Bias: none for speeds that are quadratic over the window. Of w = sin(2 pi f t), with x = 2 pi f h, the
//   slope comes out
//     as 3 sum_{k=1..n} k sin(k x) / (x n (n + 1) (n + 1/2)) of the true one:
//       10 Hz (n = 1) sin(x)/x:   -6.5 % at 1 Hz, -24 % at 2 Hz
//       50 Hz (n = 5):            -4.6 % at 1 Hz, -17 % at 2 Hz
//       200 Hz (n = 20):          -4.1 % at 1 Hz, -15 % at 2 Hz (the dense limit: 3 (sin y - y cos y)/y^3, y
//       = n x)
//   Noise: white speed noise of sd s gives a slope of sd s / (h sqrt(n (n + 1) (2 n + 1) / 3)). For s = 0.011
//   rad/s:
//     0.08 rad/s^2 at 10 Hz, 0.05 at 50 Hz, 0.03 at 200 Hz; differences of neighbours give 0.16, 0.78
//     and 3.1.
// At the ends of a record the window is one-sided and the fit falls back to a line.
inline constexpr double default_half_window_s = 0.1;

struct SpeedSample {
  double t_s = 0;
  std::array<double, 2> speed_rad_s{};
};

// The slope at window[at]; `window` is in time order. A single sample gives zero.
std::array<double, 2> fitted_acceleration(std::span<const SpeedSample> window, std::size_t at);

struct MeterSettings {
  // ERKStep's local error a sample interval, as a fraction of the energy (power scale times interval) at
  // stake in it. The power scale is the greatest of idle power and the absolute battery powers at both ends.
  double tolerance = 1e-4;
  double half_window_s = default_half_window_s;  // of the acceleration filter
  double gap_bridge_s = signals::usual_bound_s;  // bound of signals/gaps.h, for its callers
  double winding_reference_c = 25;
};

// The meter's result for one sample, complete once the acceleration filter has seen enough later samples.
struct MeterPoint {
  signals::Sample sample;
  double t_s = 0;         // since the first sample of the mission
  double interval_s = 0;  // since the previous point; 0 for the first
  bool bridged = true;    // false: the interval was a gap and was not integrated
  std::array<double, 2> wheel_acceleration_rad_s2{};
  double climb_rad = dynamics::unknown;
  double speed_m_s = 0;
  double yaw_rate_rad_s = 0;
  double measured_power_w = signals::unmeasured;
  double modelled_power_w = 0;
  std::array<double, 2> winding_temperature_c{};
};

// Integrates the energy accounts of one robot online by SUNDIALS' ERKStep (Bogacki and Shampine, order 3(2)),
// from sample to sample; in between every input is linear. A step over the whole interval is exact for rates
// that are quadratic in time, as products of two channels are; error control shortens it at kinks (a motor
// that begins to regenerate). One formula a rate, and one integration for all, keep the ledger closed to
// rounding.
//
// Not thread-safe; deterministic: the same samples give the same bits.
class Meter {
 public:
  // `emit` receives every point in time order, delayed by the filter's look-ahead: half_window_s, or one
  // sample interval where that is longer.
  Meter(dynamics::DriveModel model, MeterSettings settings, std::function<void(const MeterPoint&)> emit);
  ~Meter();
  Meter(const Meter&) = delete;
  Meter& operator=(const Meter&) = delete;

  // Takes the next sample: later than the previous one, finite where measured (src/telemetry/validation
  // rejects others), and the climb there (dynamics/climb.h; NaN: unknown). A payload of NaN counts as the
  // last one since begin(), at first 0. An error is ERKStep's; the interval's chord is then used instead.
  // `bridged`: the interval before the sample is not a gap (signals/gaps.h).
  Result<void> add(const signals::Sample& sample, double climb_rad, bool bridged = true);
  // The climb is the pitch, where that is measured.
  Result<void> add(const signals::Sample& sample) { return add(sample, sample.pitch_rad); }

  // Processes the samples that still wait for the filter, with one-sided windows.
  Result<void> flush();

  // Starts new accounts at the next sample; flush() first. The windings' temperature carries over.
  void begin();

  // Goes on with accounts from before a restart of the service; call before the first sample.
  void resume(const signals::Accounts& accounts) { accounts_ = accounts; }

  // The same where the earlier samples are available: the next samples up to `counted_utime_us` are already
  // in the accounts and only prepare the filter for later ones. NaN: a winding's temperature is unknown.
  void resume(const signals::Accounts& accounts, std::int64_t counted_utime_us,
              const std::array<double, 2>& winding_temperature_c);

  // Forgets the previous sample without ending the accounts: the time in between is not integrated. For a
  // robot's clock that was set. flush() first.
  void interrupt();

  const signals::Accounts& accounts() const { return accounts_; }
  std::size_t gaps() const { return gaps_; }  // intervals not integrated
  double gap_seconds() const { return gap_seconds_; }

 private:
  class Segment;
  struct Node;
  struct Waiting {
    signals::Sample sample;
    double climb_rad = dynamics::unknown;
    bool bridged = true;
  };

  // How far the filter's window reaches to each side: half_window_s and half a usual interval, so that a
  // shaking clock does not push samples out of it.
  double reach_s() const { return settings_.half_window_s + 0.5 * usual_interval_s_; }
  // True when every sample of the window of waiting_[index] has arrived.
  bool window_complete(std::size_t index) const;
  std::size_t fill_window(std::size_t index);
  Result<void> integrate_to(const Node& node, double interval_s);
  void skip_gap(double interval_s);
  void describe_state(const Node& node, MeterPoint& point) const;
  void keep_last(const Node& node);
  Result<void> settle(std::size_t index);

  dynamics::DriveModel model_;
  MeterSettings settings_;
  std::function<void(const MeterPoint&)> emit_;
  std::deque<Waiting> waiting_;  // the filter's window; samples before next_ are history
  std::size_t next_ = 0;         // first sample not yet settled
  std::unique_ptr<Node> last_;
  std::unique_ptr<Segment> segment_;
  std::vector<SpeedSample> window_;
  double usual_interval_s_ = 0;  // running mean of the sample intervals
  signals::Accounts accounts_;
  std::array<double, 2> copper_heat_w_{};
  double payload_kg_ = 0;
  std::int64_t origin_utime_us_ = 0;
  std::optional<std::int64_t> counted_utime_us_;  // samples up to then are in the accounts
  std::size_t gaps_ = 0;
  double gap_seconds_ = 0;
};

}  // namespace joulecast::energy
