#pragma once

namespace CLI {
class App;
}

namespace joulecast::client {

// Puts examples under the help of every command, above the exit codes.
void add_examples(CLI::App& program);

}  // namespace joulecast::client
