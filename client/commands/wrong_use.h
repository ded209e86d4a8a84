#pragma once

#include <string>

namespace CLI {
class App;
class ParseError;
}  // namespace CLI

namespace joulecast::client {

// What is wrong with the command line and what to do about it, in lines that end with a new line.
[[nodiscard]] std::string wrong_use(const CLI::App& program, const CLI::ParseError& error);

}  // namespace joulecast::client
