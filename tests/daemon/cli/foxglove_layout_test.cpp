/// The layout for Foxglove and Lichtblick names only topics and fields that recordings have.

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "abbe/messages/cdr.hpp"
#include "abbe_command.hpp"
#include "temporary_folder.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// What is wrong with a message path such as "abbe/v1/AxisSample.position[0]"; empty: nothing.
std::string fault_of_path(const std::string& path) {
  static const std::regex kPath(R"(abbe/v1/(\w+)(?:\.(\w+)(?:\[(\d+)\])?)?)");
  std::smatch part;
  if (!std::regex_match(path, part, kPath)) return path + ": no message path";
  const std::string idl{idl_text()};
  const auto begin = idl.find("struct " + part[1].str() + " {");
  if (begin == std::string::npos) return path + ": no such type";
  const std::string type = idl.substr(begin, idl.find("};", begin) - begin);
  if (type.find("topic abbe/v1/" + part[1].str() + " (recording") == std::string::npos)
    return path + ": is not recorded";
  if (!part[2].matched) return {};

  std::smatch field;
  const std::regex declared(R"((?:sequence<[\w ]+, (\d+)>|[\w ]+?) )" + part[2].str() +
                            R"((?:\[(\d+)\])?;)");
  if (!std::regex_search(type, field, declared)) return path + ": no such field";
  const std::string size = field[1].str() + field[2].str();
  if (size.empty() != !part[3].matched) return path + ": an index belongs to an array only";
  if (part[3].matched && std::stoi(part[3].str()) >= std::stoi(size)) return path + ": beyond";
  return {};
}

void collect_panels(const json& layout, std::set<std::string>& panels) {
  if (layout.is_string()) {
    panels.insert(layout.get<std::string>());
    return;
  }
  collect_panels(layout.at("first"), panels);
  collect_panels(layout.at("second"), panels);
}

json layout_printed() {
  const TemporaryFolder folder;
  const auto ran = test::run_abbe(folder.path(), "example foxglove.json");
  EXPECT_EQ(ran.exit, 0) << ran.err;
  return json::parse(ran.out);
}

TEST(FoxgloveLayout, NamesTopicsAndFieldsOfRecordings) {
  std::vector<std::string> paths, faults;
  const json layout = layout_printed();
  for (const json& panel : layout.at("configById")) {
    if (panel.contains("topicPath")) paths.push_back(panel["topicPath"]);
    for (const json& path : panel.value("paths", json::array())) paths.push_back(path.at("value"));
  }
  EXPECT_GT(paths.size(), 10u);
  for (const std::string& path : paths)
    if (std::string fault = fault_of_path(path); !fault.empty()) faults.push_back(fault);
  EXPECT_THAT(faults, IsEmpty());
}

TEST(FoxgloveLayout, ShowsEveryPanelThatItDescribes) {
  const json layout = layout_printed();
  std::set<std::string> shown, described;
  collect_panels(layout.at("layout"), shown);
  for (const auto& [name, panel] : layout.at("configById").items()) described.insert(name);
  EXPECT_EQ(shown, described);
}

/// The check itself finds what is wrong.
TEST(FoxgloveLayout, APathThatRecordingsDoNotHaveIsNoticed) {
  EXPECT_EQ(fault_of_path("abbe/v1/TrackerPoint.p_tracker_m[2]"), "");
  EXPECT_EQ(fault_of_path("abbe/v1/CalibrationEvent"), "");
  EXPECT_THAT(fault_of_path("abbe/v1/TrackerPoint.p_tracker_mm[2]"), HasSubstr("no such field"));
  EXPECT_THAT(fault_of_path("abbe/v1/TrackerPoint.p_tracker_m[3]"), HasSubstr("beyond"));
  EXPECT_THAT(fault_of_path("abbe/v1/TrackerPoint.p_tracker_m"), HasSubstr("array only"));
  EXPECT_THAT(fault_of_path("abbe/v1/AxisSample.u_time_ns[0]"), HasSubstr("array only"));
  EXPECT_THAT(fault_of_path("abbe/v1/Snapshot.touch"), HasSubstr("not recorded"));
  EXPECT_THAT(fault_of_path("abbe/v2/AxisSample"), HasSubstr("no message path"));
}

}  // namespace
}  // namespace abbe::daemon
