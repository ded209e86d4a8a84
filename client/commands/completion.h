#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace joulecast::client {

struct Candidate {
  std::string text;  // ends in '/' or '=' where more is to follow
  std::string meaning;
};

// Completions of the last of `words`, which are a command line without the program's name, in the order of
// the help. Files are those of the working directory; ids of robots come from its server.
[[nodiscard]] std::vector<Candidate> candidates(CLI::App& program, const std::vector<std::string>& words);

}  // namespace joulecast::client
