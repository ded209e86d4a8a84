#include "client/commands/examples.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <sstream>
#include <string>

namespace joulecast::client {
namespace {

struct Examples {
  const char* command;
  const char* text;  // one command a line
};

// Placeholders for the reader's files are amr.lcmlog, amr.json, history.db and the like; tests/documents
// makes these files and runs every line.
constexpr Examples example_table[] = {
    {"profile",
     "joulecast profile --robot amr.json --length 10 --payload 20\n"
     "joulecast profile --robot amr.json --length 10 --deadline 14 --json\n"
     "joulecast profile --server http://127.0.0.1:8080 --robot-id amr --turn 90deg --length 10 --pareto 5"},
    {"estimate",
     "joulecast estimate --robot amr.json --length 10 --payload 20\n"
     "joulecast estimate --example | joulecast estimate --robot amr.json --request -"},
    {"autonomy",
     "joulecast autonomy --robot amr.json --charge 0.6 --payload 20\n"
     "joulecast autonomy --robot amr.json --charge 0.6 --dialect vda5050-3.0\n"
     "joulecast autonomy --server http://127.0.0.1:8080 --robot-id amr"},
    {"matrix",
     "joulecast matrix tasks.json --robot amr.json\n"
     "joulecast matrix --example | joulecast matrix - --robot amr.json"},
    {"missions",
     "joulecast missions --server http://127.0.0.1:8080 --robot-id amr --limit 20\n"
     "joulecast missions --server http://127.0.0.1:8080 --from 2026-11-21 --state finished"},
    {"robots", "joulecast robots --server http://127.0.0.1:8080"},
    {"state", "joulecast state --server http://127.0.0.1:8080 --robot-id amr"},
    {"ledger", "joulecast ledger 1 --server http://127.0.0.1:8080"},
    {"export missions",
     "joulecast export missions --server http://127.0.0.1:8080 --from 2026-11-21 --out missions.csv"},
    {"export floor",
     "joulecast export floor --server http://127.0.0.1:8080 --from 2026-11-21 --cell 2 --out floor.csv"},
    {"export rmf",
     "joulecast export rmf --server http://127.0.0.1:8080 --robot-id amr --out fleet.yaml"},
    {"export telemetry",
     "joulecast export telemetry --server http://127.0.0.1:8080 --mission 1 --out samples.csv"},
    {"export trace",
     "joulecast export trace --server http://127.0.0.1:8080 --mission 1 --points 500 --out trace.csv"},
    {"proposals", "joulecast proposals --server http://127.0.0.1:8080"},
    {"adopt",
     "joulecast adopt --server http://127.0.0.1:8080 --robot-id amr --model amr.json --dry-run\n"
     "joulecast adopt --server http://127.0.0.1:8080 --robot-id amr --version 1"},
    {"check",
     "joulecast check amr.json mapping.json\n"
     "joulecast check amr.lcmlog --robot amr.json --json"},
    {"spy", "joulecast spy --seconds 3\njoulecast spy --seconds 3 --json"},
    {"import",
     "joulecast import runs.csv --mapping mapping.json --start 2026-03-01T08:00:00Z --out imported.lcmlog"},
    {"replay",
     "joulecast replay amr.lcmlog --speed 20\n"
     "joulecast replay amr.lcmlog --into history.db --robot amr.json"},
    {"simulate",
     "joulecast simulate --robots 4 --mission-duration 20 --duration 3 --server http://127.0.0.1:8080\n"
     "joulecast simulate --robot amr.json --robots 1 --missions 3 --speed 0 --log simulated.lcmlog\n"
     "joulecast simulate --list-effects"},
    {"gap",
     "joulecast gap amr.lcmlog --robot amr.json\n"
     "joulecast gap amr.lcmlog --robot amr.json --apply amr-adopted.json --json\n"
     "joulecast gap amr.lcmlog --robot amr.json --test fresh.lcmlog\n"
     "joulecast gap amr.lcmlog --robot amr.json --report amr-gap.html --force"},
    {"effects", "joulecast effects"},
    {"key create", "joulecast key create --file keys.json --robot-id amr-07"},
    {"key list", "joulecast key list --file keys.json"},
    {"key revoke", "joulecast key revoke --file keys.json --robot-id amr-07"},
    {"token create",
     "joulecast token create --file tokens.json --name dispatcher --role plan\n"
     "joulecast token create --file tokens.json --name yard --role operate --robots 'amr-*' --days 30"},
    {"token list", "joulecast token list --file tokens.json"},
    {"token revoke", "joulecast token revoke --file tokens.json --name yard"},
    {"audit list", "joulecast audit list --store history.db"},
    {"audit verify", "joulecast audit verify --store history.db"},
    {"store copy", "joulecast store copy --from history.db --to copy.db"},
    {"store verify", "joulecast store verify --store history.db"},
    {"store stats", "joulecast store stats --store history.db --json"},
    {"completion",
     "source <(joulecast completion bash)\n"
     "joulecast completion zsh > _joulecast.zsh\n"
     "joulecast completion fish > joulecast.fish"},
    {"calibrate drive", "joulecast calibrate drive amr.lcmlog --robot amr.json --out amr-calibrated.json"},
    {"calibrate battery",
     "joulecast calibrate battery cell --capacity-ah 2.6 --out cell.json\n"
     "joulecast calibrate battery cell_c20_data.csv cell_1c_data.csv --out cell.json --force"},
    {"battery predict",
     "joulecast battery predict cell_rw.csv --battery cell.json\n"
     "joulecast battery predict cell --battery cell.json --from power --json"},
};

// The command "calibrate drive" names: a subcommand of a subcommand.
CLI::App* find(CLI::App& program, const std::string& path) {
  std::istringstream names(path);
  CLI::App* app = &program;
  for (std::string name; names >> name;) app = app->get_subcommand(name);
  return app;
}

}  // namespace

void add_example(CLI::App& command, const char* request) {
  command.add_flag_callback(
      "--example",
      [request] {
        std::puts(request);
        throw CLI::Success();
      },
      "print an example request as JSON and exit");
}

void add_examples(CLI::App& program) {
  for (const auto& [command, text] : example_table) {
    CLI::App* app = find(program, command);
    // A footer of the command itself precedes the examples.
    std::string footer = app->get_footer() == program.get_footer() ? "" : app->get_footer() + "\n\n";
    footer += "Examples:\n  ";
    for (const char* c = text; *c != '\0'; ++c)
      footer += *c == '\n' ? std::string("\n  ") : std::string(1, *c);
    app->footer(footer + "\n\nExit codes: joulecast --help");
  }
}

}  // namespace joulecast::client
