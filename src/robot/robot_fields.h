#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "base/bounds.h"
#include "robot/robot_model.h"

namespace joulecast::robot {

using Curve = std::vector<std::pair<double, double>>;  // (state of charge, value)

// Where in the model a field lives. The kind of the member decides the JSON shape.
using Member = std::variant<std::string& (*)(RobotModel&),            // string
                            double& (*)(RobotModel&),                 // number
                            std::optional<double>& (*)(RobotModel&),  // number that may be absent
                            std::array<double, 2>& (*)(RobotModel&),  // [right, left]
                            Curve& (*)(RobotModel&),                  // {"charge": [...], value_key: [...]}
                            std::vector<BatteryBranch>& (*)(RobotModel&),  // [{element_fields()}, ...]
                            std::vector<ChargeLag>& (*)(RobotModel&),      // the same
                            std::vector<AdoptedEffect>& (*)(RobotModel&)   // {id: {parameter: number}}
                            >;

enum class Presence { required, optional };

// One key of the robot file. An absent optional number keeps the default that the model is born with.
struct Field {
  std::string_view pointer;  // JSON pointer in the robot file; its last part carries the unit
  Member member;
  Bounds bounds;  // of the number, or of every value of an array or curve
  std::string_view words;
  Presence presence = Presence::required;
  std::string_view value_key{};  // of a curve

  std::string_view key() const { return pointer.substr(pointer.rfind('/') + 1); }
};

// One key of an element of an array of objects; all are required.
template <class Element>
struct ElementField {
  std::string_view key;
  double Element::*member;
  Bounds bounds;
  std::string_view words;
};

// The description of an object of the file.
struct ObjectWords {
  std::string_view pointer, words;
};
inline constexpr std::string_view file_words =
    "Parameters of a differential-drive robot. Names end with their units. Inertia and friction are at the "
    "wheel; sides are [right, left]; the payload is over the axle. In addition to this schema a reader "
    "checks: yaw inertia against the parallel-axis bound, ascending curves, cut-off below nominal voltage, "
    "idle power within the capability of the battery.";

inline constexpr std::size_t max_curve_points = 1001;
inline constexpr std::size_t max_branches = 2;  // and charge lags
inline constexpr std::size_t max_effects = 64;
inline constexpr std::size_t max_effect_parameters = 64;
// LCM channels carry at most 63 characters, of which "ROBOT_TELEMETRY." takes 16.
inline constexpr std::string_view robot_id_pattern = "^[A-Za-z0-9._-]{1,47}$";
inline constexpr std::string_view effect_name_pattern = "^[a-z0-9_]{1,64}$";

// Every key of the robot file, once: parsing, validation, writing and the schema follow from this table.
std::span<const Field> fields();

// The keys of one element of /battery/branches and of /battery/charge_lags.
template <class Element>
std::span<const ElementField<Element>> element_fields();
template <>
std::span<const ElementField<BatteryBranch>> element_fields();
template <>
std::span<const ElementField<ChargeLag>> element_fields();

std::span<const ObjectWords> object_words();

bool is_robot_id(std::string_view text);     // robot_id_pattern
bool is_effect_name(std::string_view text);  // effect_name_pattern, for effect ids and their parameters

// The unit that ends a name ("speed_m_s" -> "m/s"), empty for pure numbers.
std::string_view unit_of(std::string_view name);

// Robots with the same text are of one kind: the parameters of their design, which no calibration, refinement
// or diagnosis changes.
std::string kind_of(const RobotModel& robot);

}  // namespace joulecast::robot
