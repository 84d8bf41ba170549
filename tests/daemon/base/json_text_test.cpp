#include "abbe/base/json_text.hpp"

#include <gmock/gmock.h>

#include <filesystem>

#include "text_files.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;

TEST(JsonText, ReplacesBytesThatAreNotUtf8) {
  const nlohmann::json object{{"name", "m\xfc.csv"}};
  EXPECT_EQ(json_text(object), "{\"name\":\"m\xef\xbf\xbd.csv\"}");
  EXPECT_EQ(indented_json_text(object), "{\n \"name\": \"m\xef\xbf\xbd.csv\"\n}");
}

TEST(JsonText, IsTheOnlyCallerOfDump) {
  for (const fs::path folder : {"daemon", "python/src", "sim", "drivers"})
    for (const auto& entry :
         fs::recursive_directory_iterator(fs::path(ABBE_SOURCE_FOLDER) / folder)) {
      const auto extension = entry.path().extension();
      if (extension != ".cpp" && extension != ".hpp") continue;
      if (entry.path().filename() == "json_text.hpp") continue;
      EXPECT_THAT(test::text_of(entry.path()), ::testing::Not(::testing::HasSubstr(".dump(")))
          << entry.path();
    }
}

}  // namespace
}  // namespace abbe::daemon
