#include "abbe/tasks/accepted_reasons.hpp"

#include <gmock/gmock.h>

namespace abbe::daemon {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(AcceptedReasons, AreAddedToThoseOfTheConfigurationOnce) {
  Config config;
  config.gate.accept = {"scale-change"};
  ASSERT_TRUE(accept_also({"scale-change", "path-orientation"}, config));
  EXPECT_THAT(config.gate.accept, ElementsAre("scale-change", "path-orientation"));
}

TEST(AcceptedReasons, AnotherNameIsRefusedWithTheKnownOnes) {
  Config config;
  const auto done = accept_also({"everything"}, config);
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, ErrorCode::Usage);
  EXPECT_THAT(done.error().text, AllOf(HasSubstr("\"everything\""), HasSubstr("scale-change"),
                                       HasSubstr("bar-temperature-change")));
}

}  // namespace
}  // namespace abbe::daemon
