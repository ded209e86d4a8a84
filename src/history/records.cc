#include "history/records.h"

#include <algorithm>

namespace joulecast::history {
namespace {

constexpr std::array<std::string_view, 4> origin_names = {"file", "http", "calibration", "diagnosis"};
constexpr std::array<std::string_view, mission_state_count> state_names = {
    "open", "finished", "aborted", "unfinished", "superseded", "interrupted"};

template <class Enum, std::size_t N>
std::optional<Enum> from(const std::array<std::string_view, N>& names, std::string_view text) {
  const auto found = std::find(names.begin(), names.end(), text);
  if (found == names.end()) return std::nullopt;
  return static_cast<Enum>(found - names.begin());
}

}  // namespace

std::string_view name(ModelOrigin origin) {
  return origin_names.at(static_cast<std::size_t>(origin));
}

std::string_view name(MissionState state) {
  return state_names.at(static_cast<std::size_t>(state));
}

std::optional<ModelOrigin> model_origin_from(std::string_view text) {
  return from<ModelOrigin>(origin_names, text);
}

std::optional<MissionState> mission_state_from(std::string_view text) {
  return from<MissionState>(state_names, text);
}

}  // namespace joulecast::history
