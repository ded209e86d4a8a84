#pragma once

namespace CLI {
class App;
}

namespace joulecast::client {

// Puts examples under the help of every command, above the exit codes.
void add_examples(CLI::App& program);

// The flag --example: prints a request that the command accepts, and exits.
void add_example(CLI::App& command, const char* request);

}  // namespace joulecast::client
