#include <cstdio>

#include "client/commands/option.h"
#include "client/commands/table.h"
#include "dynamics/catalogue.h"

namespace joulecast::client {
namespace {

struct EffectsOptions {
  bool markdown = false;
};

Result<Exit> list_effects(EffectsOptions& options) {
  std::fputs((options.markdown ? dynamics::catalogue_markdown() : dynamics::catalogue_listing()).c_str(),
             stdout);
  return Exit::ok;
}

}  // namespace

void add_effects(CLI::App& program, Exit& exit) {
  using O = EffectsOptions;
  add_command<O>(program, exit, "effects",
                 "List the effects that a robot file can adopt and a diagnosis can find", list_effects,
                 {{"--markdown", &O::markdown, "the whole document: parameters, bounds, validity, sources"}},
                 "joulecast effects");
}

}  // namespace joulecast::client
