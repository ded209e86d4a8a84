#include <iterator>

#include "signals/ids.h"
#include "telemetry/codec.h"

namespace joulecast::telemetry {
namespace {

// In the order of Subject.
constexpr std::string_view prefixes[] = {"ROBOT_TELEMETRY.", "MISSION_EVENT.", "ROBOT_COVARIATES.",
                                         "ENERGY_STATE."};

std::string_view prefix_of(Subject subject) noexcept {
  return prefixes[static_cast<std::size_t>(subject)];
}

}  // namespace

std::string channel_of(Subject subject, std::string_view robot_id) {
  return std::string(prefix_of(subject)).append(robot_id);
}

std::optional<ChannelName> parse_channel(std::string_view channel) noexcept {
  for (std::size_t k = 0; k < std::size(prefixes); ++k) {
    if (!channel.starts_with(prefixes[k])) continue;
    const std::string_view robot_id = channel.substr(prefixes[k].size());
    if (!signals::is_valid_robot_id(robot_id)) return std::nullopt;
    return ChannelName{static_cast<Subject>(k), robot_id};
  }
  return std::nullopt;
}

std::string channel_pattern(Subject subject) {
  std::string pattern(prefix_of(subject));
  return pattern.insert(pattern.size() - 1, "\\") +
         ".+";  // of the prefix only the last character, a '.', is special
}

}  // namespace joulecast::telemetry
