#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string_view>

#include "tests/study/exploration/map.h"

namespace joulecast::exploration {

// The map file, tests/study/exploration/map.schema.json. An error's field is the JSON pointer of the fault.
Result<Map> parse_map(std::string_view json_text);
Result<Map> read_map(const nlohmann::json& document);

// As parse_map; an unreadable file is Fault::not_found, and its path stands before the message.
Result<Map> load_map(const std::filesystem::path& path);

// Obstacles are written as polygons.
nlohmann::json map_to_json(const Map& map);

}  // namespace joulecast::exploration
