#include "signals/ids.h"

#include <algorithm>

namespace joulecast::signals {
namespace {

bool is_id(std::string_view id, std::size_t max_length) noexcept {
  return !id.empty() && id.size() <= max_length && std::ranges::all_of(id, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
           c == '_' || c == '-';
  });
}

}  // namespace

bool is_valid_robot_id(std::string_view id) noexcept {
  return is_id(id, max_robot_id_length);
}

bool is_valid_mission_id(std::string_view id) noexcept {
  return is_id(id, max_mission_id_length);
}

}  // namespace joulecast::signals
