#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace joulecast {

// Name of the network file system of a type (statfs(2), f_type); empty: another file system.
std::string_view network_file_system_of_type(std::int64_t type);
// The same of the file system that has the path, or the folder in which it is to be created; empty if that
// cannot be read.
std::string_view network_file_system(const std::string& path);

}  // namespace joulecast
