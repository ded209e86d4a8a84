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

// The equations in which an effect can show. Each is measured minus modelled.
enum class Channel : std::size_t {
  voltage_right,  // V - R i - K_w n w, given the measured current and speed [V]
  voltage_left,
  torque_right,  // motor current - the torque that the motion asks over K_t n [A]
  torque_left,
  drive_right,  // V - what the motion asks of motor and winding [V]; judges where no motor current is
                // measured
  drive_left,
  bus,              // battery power - what the measured motor powers ask [W]
  power,            // battery power - what the motion alone asks [W]; judges where bus cannot
  battery_voltage,  // terminal voltage + R_b i [V]
  gyro,             // yaw rate - the wheels' [rad/s]
  travel,           // progress on the map over a span - the wheels' [m]
  turn              // change of heading over a span - the wheels' [rad]
};
inline constexpr std::size_t channel_count = 12;

constexpr std::size_t index_of(Channel channel) {
  return static_cast<std::size_t>(channel);
}

// As named in answers; both sides of a pair share a name.
std::string_view name_of(Channel channel);

template <class S>
using ChannelValues = std::array<S, channel_count>;

// What is judged from motion alone because the motors' currents are not measured.
struct FromMotion {
  bool power = false;    // Channel::power speaks; it costs as much as the others together
  bool voltage = false;  // Channel::drive_right and drive_left do
  // The gyro and the map are equations, and what they show are causes. Where battery power is all that was
  // measured of power, checks compare them instead.
  bool kinematics = true;
  bool alone() const { return power && !voltage; }
};

// How recordings that were read like this are judged.
FromMotion from_motion_of(const windows::Readings& readings);

// Residuals of one window. Value NaN: the channel does not speak here.
template <class S>
ChannelValues<S> residuals(const dynamics::BasicDriveModel<S>& model, const Window& w,
                           const FromMotion& from_motion);

extern template ChannelValues<double> residuals(const dynamics::BasicDriveModel<double>&, const Window&,
                                                const FromMotion&);
extern template ChannelValues<dynamics::Dual> residuals(const dynamics::BasicDriveModel<dynamics::Dual>&,
                                                        const Window&, const FromMotion&);

// Leaves out windows whose motion is not known, as of a mission whose wheels a check silenced: nothing asks
// for their power.
void keep_known_motion(std::vector<Window>& windows);

// The battery power that the motion asks, as the robot's meter would read it [W].
template <class S>
S metered_power(const dynamics::BasicDriveModel<S>& model, const Window& w);

// The same, and the electrical power of both motors as their sensors would read it [W].
template <class S>
struct MeteredPower {
  S battery_w = 0, motors_w = 0;
  std::array<S, 2> motor_w{};  // of each motor
};
template <class S>
MeteredPower<S> metered_powers(const dynamics::BasicDriveModel<S>& model, const Window& w);

extern template double metered_power(const dynamics::BasicDriveModel<double>&, const Window&);
extern template dynamics::Dual metered_power(const dynamics::BasicDriveModel<dynamics::Dual>&, const Window&);
extern template MeteredPower<double> metered_powers(const dynamics::BasicDriveModel<double>&, const Window&);
extern template MeteredPower<dynamics::Dual> metered_powers(const dynamics::BasicDriveModel<dynamics::Dual>&,
                                                            const Window&);

}  // namespace joulecast::gap
