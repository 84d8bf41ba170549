/// Limits: the guard band of ISO 14253-1, and limits that cannot be judged.
#include "abbe/report/conformity.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "synthetic_model.hpp"

namespace abbe::daemon {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

TEST(Conformity, PassesOnlyIfTheWholeUncertaintyIsWithinTheLimit) {
  EXPECT_EQ(conformity_of(8.0, 2.0, 10.0), Conformity::Pass);
  EXPECT_EQ(conformity_of(-8.0, 2.0, 10.0), Conformity::Pass);
  EXPECT_EQ(conformity_of(8.0, 2.5, 10.0), Conformity::Neither);
}

TEST(Conformity, FailsOnlyIfTheWholeUncertaintyIsBeyondTheLimit) {
  EXPECT_EQ(conformity_of(13.0, 2.0, 10.0), Conformity::Fail);
  EXPECT_EQ(conformity_of(-13.0, 2.0, 10.0), Conformity::Fail);
  EXPECT_EQ(conformity_of(12.0, 2.0, 10.0), Conformity::Neither) << "|value| - U is the limit";
  EXPECT_EQ(conformity_of(std::nan(""), 1.0, 10.0), Conformity::Neither);
  EXPECT_EQ(conformity_of(1.0, std::nan(""), 10.0), Conformity::Neither);
}

TEST(Conformity, JudgesValuesOfTheModelBeforeTheyAreRounded) {
  const auto values = certified_values(test::synthetic_document(3)).value();
  const auto& M = values.standard.positioning[0].M;
  const double most_um = 1e6 * (M.value + 2.0 * M.u), least_um = 1e6 * (M.value - 2.0 * M.u);
  const auto judged = judge(values, {{.value = "X.M", .limit_um_urad = 1.000001 * most_um},
                                     {.value = "X.M", .limit_um_urad = 0.999999 * most_um},
                                     {.value = "X.M", .limit_um_urad = 0.999999 * least_um}})
                          .value();
  EXPECT_EQ(judged[0].conformity, Conformity::Pass);
  EXPECT_EQ(judged[1].conformity, Conformity::Neither);
  EXPECT_EQ(judged[2].conformity, Conformity::Fail);
  EXPECT_EQ(conformity_of_all(judged), Conformity::Fail);
}

TEST(Conformity, OfWhatIsLeftPassesWithTheBoundAndNeverFails) {
  const auto values = certified_values(test::synthetic_document(3)).value();
  const double U_um = 1e6 * values.volume.max_U_m;
  const auto judged = judge(values, {{.value = "U.max", .limit_um_urad = 1.01 * U_um},
                                     {.value = "U.max", .limit_um_urad = 0.01 * U_um}})
                          .value();
  EXPECT_EQ(judged[0].conformity, Conformity::Pass);
  EXPECT_EQ(judged[1].conformity, Conformity::Neither);
}

TEST(Conformity, OfAValueThatIsNotEstimableIsNeither) {
  const auto values = certified_values(test::synthetic_document(3)).value();
  const auto judged = judge(values, {{.value = "X.B", .limit_um_urad = 1e6}}).value();
  EXPECT_EQ(judged[0].conformity, Conformity::Neither);
  EXPECT_EQ(conformity_of_all(judged), Conformity::Neither);
}

// One tool offset: the model has EAX, but neither EAZ nor the error EC0Y of its own.
TEST(Conformity, OfAnAngleThatIsNotEstimableIsNeitherAndHasALimitInUrad) {
  auto values = certified_values(test::synthetic_document(3)).value();
  const auto has = [&values](const std::string& key) {
    for (const ValueGroup& group : values.groups)
      for (const CertifiedValue& value : group.values)
        if (value.key == key) return true;
    return false;
  };
  ASSERT_FALSE(has("ECZ"));
  const auto judged =
      judge(values, {{.value = "ECZ", .limit_um_urad = 20.0, .is_angle = true}}).value();
  EXPECT_EQ(judged[0].conformity, Conformity::Neither);
  EXPECT_TRUE(judged[0].value.is_angle);
  const auto length = judge(values, {{.value = "ECZ", .limit_um_urad = 20.0}});
  ASSERT_FALSE(length);
  EXPECT_THAT(length.error().details, Contains(HasSubstr("\"ECZ\": it is an angle: limit_urad")));
}

TEST(Conformity, NamesAllLimitsThatCannotBeJudged) {
  const auto values = certified_values(test::synthetic_document(3)).value();
  const auto judged = judge(values, {{.value = "X.Q", .limit_um_urad = 1.0},
                                     {.value = "V.mean", .limit_um_urad = 1.0},
                                     {.value = "EC0Y", .limit_um_urad = 1.0},
                                     {.value = "X.M", .limit_um_urad = 1.0, .is_angle = true}});
  ASSERT_FALSE(judged);
  EXPECT_EQ(judged.error().code, ErrorCode::BadInput);
  const auto& details = judged.error().details;
  EXPECT_THAT(details, Contains(HasSubstr("\"X.Q\": the model has no such value")));
  EXPECT_THAT(details, Contains(HasSubstr("\"V.mean\": it has no uncertainty")));
  EXPECT_THAT(details, Contains(HasSubstr("\"EC0Y\": it is an angle: limit_urad")));
  EXPECT_THAT(details, Contains(HasSubstr("\"X.M\": it is a length: limit_um")));
  EXPECT_THAT(details, Contains(HasSubstr("with an uncertainty: V.max")));
}

}  // namespace
}  // namespace abbe::daemon
