#pragma once

#include <string>

namespace CLI {
class App;
class ParseError;
}  // namespace CLI

namespace joulecast::client {

// The message for an invalid command line, with a suggestion, in lines that end with a newline.
[[nodiscard]] std::string wrong_use(const CLI::App& program, const CLI::ParseError& error);

}  // namespace joulecast::client
