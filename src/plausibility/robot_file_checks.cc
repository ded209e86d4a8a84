#include <fmt/format.h>

#include <array>
#include <cmath>
#include <string>

#include "plausibility/evaluation.h"

namespace joulecast::plausibility {
namespace {

constexpr double far = 1.3;  // times the file's value, or its inverse

class List {
 public:
  // Adds `ratio`, over the file's value, if its whole interval is far from 1; else returns false.
  bool add(const char* name, const Estimate& ratio) {
    const auto interval = ratio.interval();
    if (!ratio.known() || !(ratio.value > 0)) return false;
    if (!(interval[0] > far || interval[1] < 1 / far)) return false;
    text_ += fmt::format("{}{} {:.3g} times", text_.empty() ? "" : ", ", name, ratio.value);
    const double size = std::fabs(std::log(ratio.value));
    if (size > most_) most_ = size, worst_ = ratio;
    return true;
  }
  const std::string& text() const { return text_; }
  const Estimate& worst() const { return worst_; }

 private:
  std::string text_;
  double most_ = 0;
  Estimate worst_;
};

// Estimate of the side nearer to the file, as the other may have a fault of its own.
Estimate nearer(const Estimate& right, const Estimate& left) {
  if (!right.known() || !left.known()) return right.known() ? right : left;
  return std::fabs(std::log(std::fabs(right.value))) < std::fabs(std::log(std::fabs(left.value))) ? right
                                                                                                  : left;
}

}  // namespace

void check_robot_file(const CheckContext& c, Checks& checks) {
  List list;
  const dynamics::Parameters<double>& p = c.model.parameters();
  const auto& m = c.motors;
  const bool motors = c.has({0, 1, 2, 3, 4, 5}), currents = c.has({0, 1, 4, 5});
  const bool battery = c.heard({reading::battery_voltage, reading::battery_current});
  std::string gear;
  Estimate constant;
  if (motors) {
    list.add("motor resistance", nearer(m[0].resistance_ohm * (1 / p.resistance_ohm[0]),
                                        m[1].resistance_ohm * (1 / p.resistance_ohm[1])));
    const Estimate ratio = nearer(m[0].constant_v_s_rad * (1 / p.voltage_constant_v_s_rad),
                                  m[1].constant_v_s_rad * (1 / p.voltage_constant_v_s_rad));
    if (list.add("voltage constant with gear", ratio)) constant = ratio;
  }
  if (currents) {
    const Estimate ratio = nearer(c.friction_ratio(0), c.friction_ratio(1));
    // Both depend on the gear ratio, one inversely to the other.
    if (list.add("friction", ratio) && constant.known() &&
        std::fabs(std::log(ratio.value * constant.value)) < same_ratio) {
      gear = fmt::format(", as with a gear_ratio {:.3g} times the robot's", 1 / constant.value);
    }
  }
  if (battery) {
    const Estimate idle = ratio_of_sums(c.blocks(Relation::idle), 0, 1, 1);
    const double file = p.idle_power_w + p.accessory_power_w;
    // A file may omit an idle power that is negligible compared with the drive's.
    const Estimate driving = ratio_of_sums(c.blocks(Relation::driving), 0, 2, 2);
    if (driving.known() && std::fabs(idle.value - file) > 0.05 * std::fabs(driving.value) && file > 0) {
      list.add("idle power", idle * (1 / file));
    }
    if (!currents && c.heard({0, 1})) {
      list.add("power while driving", ratio_of_sums(c.blocks(Relation::driving), 0, 1, 2));
    }
  }
  if (list.text().empty()) return;
  checks.push_back(
      make_check("robot_file", "", list.worst(),
                 fmt::format("The robot file is far from this robot: {} the file's{}.", list.text(), gear)));
}

}  // namespace joulecast::plausibility
