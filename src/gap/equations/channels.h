#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string_view>

#include "dynamics/drive_model.h"
#include "windows/windows.h"

namespace joulecast::gap {

using windows::missing;
using windows::Window;

// The equations in which an effect can be visible. Each is measured minus modelled.
enum class Channel : std::size_t {
  voltage_right,  // V - R i - K_w n w, given the measured current and speed [V]
  voltage_left,
  torque_right,  // motor current - the torque that the motion needs over K_t n [A]
  torque_left,
  drive_right,  // V - the voltage that the motion needs at motor and winding [V]; used where no motor current
                // is measured
  drive_left,
  bus,    // battery power - the power that the measured motor powers need [W]
  power,  // battery power - the power that the motion alone needs [W]; used where bus is unavailable
  battery_voltage,  // terminal voltage + R_b i [V]
  gyro,             // yaw rate - the wheels' [rad/s]
  travel,           // progress on the map over a span - the wheels' [m]
  turn              // change of heading over a span - the wheels' [rad]
};
inline constexpr std::size_t channel_count = 12;

constexpr std::size_t index_of(Channel channel) {
  return static_cast<std::size_t>(channel);
}

// The name in answers; both sides of a pair share a name.
std::string_view name_of(Channel channel);

template <class S>
using ChannelValues = std::array<S, channel_count>;

// Residuals of one window; that of Channel::power has rows of its own. Value NaN: the channel is unavailable
// here. `no_currents`: no motor's current was measured, drive_right and drive_left are used.
template <class S>
ChannelValues<S> residuals(const dynamics::BasicDriveModel<S>& model, const Window& w, bool no_currents);

extern template ChannelValues<double> residuals(const dynamics::BasicDriveModel<double>&, const Window&,
                                                bool);
extern template ChannelValues<dynamics::Dual> residuals(const dynamics::BasicDriveModel<dynamics::Dual>&,
                                                        const Window&, bool);

// The battery power that the motion needs, as the robot's meter would read it, and the electrical power of
// both motors as their sensors would read it [W].
template <class S>
struct MeteredPower {
  S battery_w = 0, motors_w = 0;
  std::array<S, 2> motor_w{};  // of each motor
};
template <class S>
MeteredPower<S> metered_powers(const dynamics::BasicDriveModel<S>& model, const Window& w);

extern template MeteredPower<double> metered_powers(const dynamics::BasicDriveModel<double>&, const Window&);
extern template MeteredPower<dynamics::Dual> metered_powers(const dynamics::BasicDriveModel<dynamics::Dual>&,
                                                            const Window&);

// Whether any voltage of a motor was read.
bool voltages_read(std::span<const Window> windows);

// One motor's voltage in a window [V]: as it was read, or as the file's winding needs it for the current and
// the speed. NaN where neither is available.
double motor_voltage(const Window& w, const robot::RobotModel& robot, std::size_t side);

// Power of both motors in a window [W]; where no motor's voltage was read at all (`volts_read` false) by the
// voltages that the file's windings need. NaN without both currents.
double motors_power(const Window& w, const robot::RobotModel& robot, bool volts_read);

}  // namespace joulecast::gap
