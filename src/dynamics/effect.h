#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "dynamics/dual.h"
#include "dynamics/motion.h"
#include "dynamics/parameters.h"

namespace joulecast::dynamics {

enum class ActsOn { wheel_torque, inertia, motor, battery_side, kinematics, sensors };

// One named number of an effect. The first one of every effect is its strength: at zero the effect is absent.
struct EffectParameter {
  std::string_view name;
  std::string_view unit;  // "1" for a pure number
  double initial;         // for shapes: where a search starts; for the strength: 0
  double minimum;
  double maximum;
  std::string_view meaning;
  bool strength = false;  // like the first: acts alone, and adds up over repeated findings
};

// What an effect depends on besides the motion of the wheels; while that is unknown, the effect is absent.
enum class Needs { nothing, position, heading, climb };

// Description of an effect for people and for tools; the bounds of its parameters are binding.
struct EffectInfo {
  std::string_view id;
  ActsOn acts_on;
  std::string_view formula;
  std::string_view validity;
  std::string_view source;
  std::vector<EffectParameter> parameters;
  Needs needs = Needs::nothing;

  bool depends_on_place() const { return needs == Needs::position || needs == Needs::heading; }
};

// Torques on the wheels that the motors must overcome, without inertia: [N m] at the wheel, positive
// resists forward rotation. One row for each ledger term that they feed.
enum class Load : std::size_t { internal, rolling, scrub, zone, drag, potential };
inline constexpr std::size_t load_count = 6;

template <class S>
struct Loads {
  std::array<std::array<S, 2>, load_count> torque{};

  void wheel(Load load, std::size_t side, S torque_nm) {
    torque[static_cast<std::size_t>(load)][side] += torque_nm;
  }
};

// Inputs of a load.
template <class S>
struct LoadContext {
  const Instant& at;
  const Parameters<S>& parameters;
  const Body<S>& body;
  std::array<double, 2> direction;  // smooth sign of each wheel's rotation
  S weight_n;                       // whole robot with its payload
  S payload_weight_n;

  // A force on the body, positive pushing it backwards, shared by both wheels.
  void force(Loads<S>& loads, Load load, S force_n) const {
    for (std::size_t s : {0u, 1u}) loads.wheel(load, s, parameters.wheel_radius_m[s] * force_n * 0.5);
  }
  // A yaw moment on the body, positive turning it to the right.
  void moment(Loads<S>& loads, Load load, S moment_nm) const {
    const S arm = moment_nm / (2.0 * parameters.half_track_m);
    loads.wheel(load, 0, parameters.wheel_radius_m[0] * arm);
    loads.wheel(load, 1, S(-1) * parameters.wheel_radius_m[1] * arm);
  }
};

inline constexpr std::size_t max_effect_parameters = 5;
template <class S>
using EffectValues = std::array<S, max_effect_parameters>;

// A physical effect that the nominal model leaves out: it changes constants or adds torque at the wheels, in
// double and in Dual, so that every derivative is exact. All are in the table of effects.cc.
class Effect {
 public:
  virtual ~Effect() = default;
  virtual const EffectInfo& info() const = 0;
  virtual bool loads() const = 0;  // load() adds torque
  virtual void adjust(const EffectValues<double>&, Parameters<double>&) const = 0;
  virtual void adjust(const EffectValues<Dual>&, Parameters<Dual>&) const = 0;
  virtual void load(const EffectValues<double>&, const LoadContext<double>&, Loads<double>&) const = 0;
  virtual void load(const EffectValues<Dual>&, const LoadContext<Dual>&, Loads<Dual>&) const = 0;
};

}  // namespace joulecast::dynamics
