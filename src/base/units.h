#pragma once

namespace joulecast {

inline constexpr double seconds_per_hour = 3600;
inline constexpr double seconds_per_microsecond = 1e-6;

}  // namespace joulecast
