#include "server/api/described.h"

#include <deque>
#include <string>
#include <utility>
#include <vector>

#include "answers/json/autonomy_json.h"
#include "answers/json/estimate_json.h"
#include "answers/json/ledger_json.h"
#include "answers/json/matrix_json.h"
#include "answers/json/mission_json.h"
#include "answers/json/profile_json.h"
#include "server/api/requests.h"
#include "server/api/robot_json.h"

namespace joulecast::api {
namespace {

// Texts that last as long as the program.
struct Described {
  Described() {
    described::Schemas made = maps_schemas();
    for (const described::Schemas& more :
         {answers::drive_schemas(), answers::matrix_schemas(), answers::autonomy_schemas(),
          answers::profile_schemas(), answers::estimate_schemas(), request_schemas(), diagnosis_schemas(),
          mission_schemas(), mission_request_schemas(), fleet_autonomy_schemas(), robot_schemas(),
          model_schemas()})
      made.insert(made.end(), more.begin(), more.end());
    made.insert(made.end(), {{"accounts", answers::accounts_table().schema()},
                             {"audit", audit_schema()},
                             {"cluster", cluster_schema()},
                             {"contradiction", contradiction_table().schema()},
                             {"event-log", event_log_schema()},
                             {"floor-map", floor_map_schema()},
                             {"gap-history", gap_history_schema()},
                             {"ledger", answers::ledger_table().schema()},
                             {"mission-totals", totals_schema()},
                             {"recent-values", recent_values_schema()},
                             {"tariff", tariff_schema()}});
    for (const auto& [name, schema] : made) {
      const std::string& file = texts.emplace_back(name + ".schema.json");
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
