#pragma once

#include <array>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "client/virtual_robot/rng.h"
#include "tests/study/trial/motion/base_power.h"

// Effects planted into recorded motion, by formulas of the trial's own.
namespace joulecast::trial::motion {

// Quantities that a planted effect may depend on in addition to the instant.
struct Scene {
  BaseForm form;
  Terms base{};
  double half_track_m = 0;
  double top_m_s = 0;        // 95 % of the time the wheels' rims are slower
  double top_yaw_rad_s = 0;  // likewise
  double nominal_voltage_v = 0;
  double motor_power_w = 0;  // mean over time of both motors' absolute power
  double base_power_w = 0;   // mean absolute base power
  double slow_m_s = 0.1;     // where friction at low speed has faded; drawn for each case
  double slow_exponent = 1;
};

// Forces at the rims of both wheels that oppose forward rotation [N], and powers, at one instant.
struct Moment {
  const Instant& at;
  std::array<double, 2> transmitted_n{};  // inertia, scrub and drag: transmitted by the gear
  std::array<double, 2> friction_n{};
  std::array<double, 2> motor_w{};
  double power_w = 0;  // out of the battery
};

// The stage at which an effect enters. `reading`: it changes the reading of the battery's current sensor, not
// the drawn current.
enum class Stage { transmitted, friction, gear, battery, reading };

// One form of one effect: its power or force at a strength of one, N of one side or W (then of side 0 alone),
// and its greatest strength.
struct Form {
  std::string_view id;    // of the effect of the catalogue that it is, or comes nearest to
  std::string_view form;  // in words
  bool catalogue = true;  // false: differs from the catalogue's form
  Stage stage = Stage::battery;
  double (*unit)(const Scene&, const Moment&, std::size_t side) = nullptr;
  double most = 0;
  double (*least)(const Scene&) = nullptr;  // most negative strength; null: none may be negative
};
[[nodiscard]] std::span<const Form> forms();

struct Planted {
  const Form* form = nullptr;
  double strength = 0;
  double gap = 0;  // mean absolute power that it adds alone, over the mean absolute base power
};

// Battery power with these effects in force [W].
struct MeteredPower {
  double drawn_w = 0;  // out of the battery
  double read_w = 0;   // as the current sensor has it
};
[[nodiscard]] MeteredPower planted_power(const Scene& scene, std::span<const Planted> planted,
                                         const Instant& at);

// The planted effect at the strength, of that sign, that adds this gap; empty where the motion or its bounds
// do not allow it.
[[nodiscard]] std::optional<Planted> planted_at(const Scene& scene, const Form& form, double gap,
                                                bool downward, std::span<const Instant> instants);

[[nodiscard]] Scene scene_of(const MotionLog& log, const BaseFit& fit, virtual_robot::Rng& rng);

// Correlation about zero of the contributions of two effects: 1 when no data can distinguish them.
[[nodiscard]] double likeness(const Scene& scene, const Planted& a, const Planted& b,
                              std::span<const Instant> instants);

// Loads that no effect of the catalogue describes.
enum class OutsideLoad { falling_heater, bursts, places, random_walk, standstill };
inline constexpr std::size_t outside_load_count = 5;
[[nodiscard]] std::string_view name_of(OutsideLoad load);

// One value for each instant, of mean 1 [W]; empty where the motion cannot show it (a standstill load without
// both rest and motion).
[[nodiscard]] std::vector<double> outside_load_w(OutsideLoad load, std::span<const Instant> instants,
                                                 virtual_robot::Rng& rng);

}  // namespace joulecast::trial::motion
