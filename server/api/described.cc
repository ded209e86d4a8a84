#include "server/api/described.h"

#include <deque>
#include <string>
#include <utility>
#include <vector>

#include "answers/json/ledger_json.h"

namespace joulecast::api {
namespace {

// Texts that last as long as the program.
struct Described {
  Described() {
    std::vector<std::pair<const char*, described::Schema>> made = maps_schemas();
    made.insert(made.end(), {{"accounts", answers::accounts_table().schema()},
                             {"cluster", cluster_schema()},
                             {"gap-history", gap_history_schema()},
                             {"ledger", answers::ledger_table().schema()},
                             {"mission-totals", totals_schema()},
                             {"robot-check", robot_check_schema()},
                             {"tariff", tariff_schema()},
                             {"terms", answers::terms_table().schema()}});
    for (const auto& [name, schema] : made) {
      const std::string& file = texts.emplace_back(std::string(name).append(".schema.json"));
      files.push_back({file, texts.emplace_back(schema.dump())});
    }
    const auto embedded = embedded_schemas();
    files.insert(files.end(), embedded.begin(), embedded.end());
  }

  std::deque<std::string> texts;
  std::vector<EmbeddedFile> files;
};

}  // namespace

std::span<const EmbeddedFile> schemas() {
  static const Described described;
  return described.files;
}

}  // namespace joulecast::api
