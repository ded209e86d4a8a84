#include "energy/untold_parameters.h"

#include <array>
#include <string>

namespace joulecast::energy {
namespace {

constexpr double told_deviation = 0.5;  // of the expected deviation
// Information of a parameter alone, with all others fixed: below this the motion is insufficient, above
// it another parameter interferes.
constexpr double own_information = 3;

constexpr std::array<std::string_view, power_parameter_count> not_in_the_motion{
    "power barely differs from zero",
    "the robot barely moves",
    "both wheels turn alike, so that only the sum of their frictions counts",
    "the robot barely moves, or always at one speed",
    "the speed changes too little",
    "the rate of turning changes too little",
    "it changes only the copper loss, which is too small",
    "the robot barely turns",
    "the motors' power barely differs from that of friction and inertia",
    "the motors barely brake"};

constexpr std::array<std::string_view, power_parameter_count> meanings{
    "computers, drivers and all other loads at rest",
    "",
    "",
    "",
    "m r^2/2 + I_w + I_s; rotors: the part that the file's mass does not explain",
    "2 I c^2 + I_w + I_s",
    "from the copper loss alone, as resistance / torque constant^2",
    "effect, adopted",
    "effect, adopted",
    "effect, adopted"};

// The parameter that most reduces the variance of `p` when it is fixed; `p` itself where none does.
PowerParameter in_the_way(const PowerParameters& parameters, const PowerFit& fit, PowerParameter p) {
  Eigen::MatrixXd precision = fit.information;
  precision.diagonal().array() += 1;
  const auto variance = [&](PowerParameter known) {
    Eigen::MatrixXd with = precision;
    if (known != p) with(index_of(known), index_of(known)) += 1e9;
    return with.inverse()(index_of(p), index_of(p));
  };
  PowerParameter most = p;
  double least = variance(p);
  for (const PowerParameter other : all_power_parameters) {
    if (other == p || !(parameters.expected(other) > 0) || !(variance(other) < 0.9 * least)) continue;
    least = variance(other);
    most = other;
  }
  return most;
}

std::string why(const PowerParameters& parameters, const PowerFit& fit, PowerParameter p) {
  const auto at = static_cast<std::size_t>(p);
  const Eigen::Index k = index_of(p);
  if (!(fit.information(k, k) > own_information)) return std::string(not_in_the_motion[at]);
  const PowerParameter other = in_the_way(parameters, fit, p);
  if (other == p) return "several others together change power in the same way in this motion";
  return std::string(power_parameter_names[static_cast<std::size_t>(other)]) +
         " changes power in nearly the same way in this motion";
}

}  // namespace

bool is_identified(const PowerParameters& parameters, const PowerFit& fit, PowerParameter p) {
  return parameters.expected(p) > 0 && fit.deviation[index_of(p)] < told_deviation;
}

std::vector<ParameterEstimate> power_estimates(const PowerParameters& parameters, const PowerFit& fit,
                                               const PowerFree& free) {
  std::vector<ParameterEstimate> estimates;
  for (const PowerParameter p : all_power_parameters) {
    const auto at = static_cast<std::size_t>(p);
    const bool known = !(parameters.expected(p) > 0), seen = is_identified(parameters, fit, p);
    if (is_effect(p) && !seen && !free[at]) continue;
    ParameterEstimate e{power_parameter_names[at],
                        power_parameter_units[at],
                        parameters.value(p, fit.x),
                        parameters.expected(p) * fit.deviation[index_of(p)],
                        seen,
                        std::string(meanings[at])};
    if (known) e.note = "given as known";
    if (!known && !seen) e.note = "stays near the file's: " + why(parameters, fit, p);
    if (is_effect(p) && !free[at]) e.note = "not detected";
    estimates.push_back(std::move(e));
  }
  return estimates;
}

std::vector<Untold> untold_parameters(const PowerParameters& parameters, const PowerFit& fit) {
  std::vector<Untold> untold;
  for (const PowerParameter p : all_power_parameters) {
    if (!(parameters.expected(p) > 0) || is_identified(parameters, fit, p)) continue;
    untold.push_back(
        {std::string(power_parameter_names[static_cast<std::size_t>(p)]), why(parameters, fit, p)});
  }
  untold.push_back({"torque_constant_nm_a, voltage_constant_v_s_rad",
                    "torque times speed is the same power for any constants; only the copper loss depends on "
                    "them, together with the resistance. The file's are kept"});
  untold.push_back({"gear efficiency",
                    "a loss in proportion to the torque appears as friction, inertia and resistance, "
                    "which include it"});
  untold.push_back(
      {"mass, yaw inertia and rotor inertia separately",
       "changes of speed determine only their sums, the straight and the turning inertia; a slope "
       "would determine the mass"});
  untold.push_back(
      {"wheel_radius_m, half_track_m",
       "friction and inertia are estimated for the file's; a map or a gyroscope determines these"});
  untold.push_back({"battery internal_resistance_ohm",
                    "its loss is not in the power at the terminals; see joulecast calibrate battery"});
  return untold;
}

}  // namespace joulecast::energy
