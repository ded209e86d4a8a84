#include "history/store_content.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include "history/audit.h"
#include "history/covariate_chunk.h"
#include "history/sql_rows.h"
#include "history/telemetry_chunk.h"

namespace joulecast::history {
namespace {

class ContentCheck {
 public:
  explicit ContentCheck(Database& database) : database_(database) {}

  ContentReport run() {
    pages([this](std::int64_t after) { return missions(after); });
    pages([this](std::int64_t after) { return chunks("telemetry_chunk", "samples", after, decode_chunk); });
    pages([this](std::int64_t after) {
      return chunks("covariate_chunk", "changes", after, decode_covariates);
    });
    section([this] {
      if (const auto audit = verify_audit(database_, "audit"); !audit)
        report_.add_fault(audit.error().message);
    });
    return std::move(report_);
  }

 private:
  // Damage that prevents reading is reported as a fault.
  template <class Work>
  void section(Work work) {
    try {
      work();
    } catch (const SqlError& error) {
      if (error.fault() != Fault::corrupt) throw;
      report_.add_fault(error.what());
    }
  }

  // A page answers the last key that it read, or the one that it began after when there is no more.
  template <class Page>
  void pages(Page page) {
    section([&] {
      for (std::int64_t after = 0, last = page(after); last != after; last = page(after)) after = last;
    });
  }

  std::int64_t missions(std::int64_t after) {
    static const std::string sql = "SELECT mission_key, " + columns_of<Mission>() +
                                   " FROM mission WHERE mission_key > ? ORDER BY mission_key LIMIT 500";
    Rows rows(database_.statement(sql));
    rows.bind(after);
    while (rows.next()) {
      ++report_.missions;
      after = rows.integer();
      if (const auto mission = read_record<Mission>(rows))
        add_ledger(*mission);
      else
        report_.add_fault("mission " + std::to_string(after) + ": " + describe(mission.error()));
    }
    return after;
  }

  // Ledgers are sums of many rounded steps, so their residual is compared with the magnitude of their terms.
  void add_ledger(const Mission& mission) {
    const auto& ledger = mission.accounts.ledger;
    const double residual_j = std::abs(ledger.total() - mission.accounts.battery_j);
    if (std::isnan(residual_j)) return;  // not available
    ++report_.ledgers;
    report_.worst_residual_j = std::max(report_.worst_residual_j, residual_j);
    double scale_j = 1;
    for (const double term_j : ledger.value) scale_j += std::abs(term_j);
    constexpr double closes = 1e-6;
    if (residual_j > closes * scale_j)
      report_.add_fault("mission " + std::to_string(mission.key) + ": its ledger adds up to " +
                        std::to_string(ledger.total()) + " J, and " +
                        std::to_string(mission.accounts.battery_j) + " J left the battery");
  }

  template <class Decode>
  std::int64_t chunks(const std::string& table, const std::string& items, std::int64_t after, Decode decode) {
    Rows rows(database_.statement("SELECT chunk_key, mission_key, " + items +
                                  ", start_utime_us, end_utime_us, body FROM " + table +
                                  " WHERE chunk_key > ? ORDER BY chunk_key LIMIT 200"));
    rows.bind(after);
    while (rows.next()) {
      after = rows.integer();
      const std::int64_t mission = rows.integer(), count = rows.integer(), start = rows.integer(),
                         end = rows.integer();
      const auto decoded = decode(rows.blob());
      const std::string which =
          table + " " + std::to_string(after) + " of mission " + std::to_string(mission);
      ++report_.chunks;
      if (!decoded) {
        report_.add_fault(which + ": " + describe(decoded.error()));
      } else if (!std::cmp_equal(decoded->size(), count) || !spans(*decoded, start, end)) {
        report_.add_fault(which + ": holds other " + items + " than its row states");
      }
    }
    return after;
  }

  template <class Items>
  static bool spans(const Items& items, std::int64_t start_utime_us, std::int64_t end_utime_us) {
    const auto earlier = [](const auto& a, const auto& b) { return a.utime_us < b.utime_us; };
    const auto [first, last] = std::minmax_element(items.begin(), items.end(), earlier);
    return first != items.end() && first->utime_us == start_utime_us && last->utime_us == end_utime_us;
  }

  Database& database_;
  ContentReport report_;
};

}  // namespace

void ContentReport::add_fault(std::string text) {
  if (faults.size() < max_faults) faults.push_back(std::move(text));
  ++fault_count;
}

ContentReport check_content(Database& database) {
  return ContentCheck(database).run();
}

}  // namespace joulecast::history
