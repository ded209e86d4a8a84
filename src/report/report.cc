#include "report/report.h"

#include <nlohmann/json.hpp>
#include <string_view>

#include "robot/robot_file.h"

namespace joulecast::report {

extern const std::string_view report_template;  // server/web/report.template, embedded at build

std::string report_html(const nlohmann::ordered_json& diagnosis, const robot::RobotModel& robot,
                        const ReportOrigin& origin) {
  using Json = nlohmann::ordered_json;
  const Json data = {{"result", diagnosis},
                     {"robot", robot::robot_to_json(robot)},
                     {"origin",
                      {{"sources", origin.sources},
                       {"model", origin.model},
                       {"made_at", origin.made_at},
                       {"software", origin.software}}}};
  std::string text = data.dump(-1, ' ', false, Json::error_handler_t::replace);
  // No tag begins within the data. In JSON, < is in strings only.
  for (auto at = text.find('<'); at != std::string::npos; at = text.find('<', at))
    text.replace(at, 1, "\\u003c");
  constexpr std::string_view mark = "@DATA@";
  std::string html(report_template);
  return html.replace(html.find(mark), mark.size(), text);
}

}  // namespace joulecast::report
