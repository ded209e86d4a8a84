#include "gap/checks/readings.h"

namespace joulecast::gap {

bool belongs_to(std::string_view reading, std::string_view channels) {
  while (!channels.empty()) {
    const std::size_t end = channels.find(", ");
    const std::string_view channel = channels.substr(0, end);
    if (reading.starts_with(channel) &&
        (reading.size() == channel.size() || reading[channel.size()] == '.')) {
      return true;
    }
    if (end == std::string_view::npos) break;
    channels.remove_prefix(end + 2);
  }
  return false;
}

}  // namespace joulecast::gap
