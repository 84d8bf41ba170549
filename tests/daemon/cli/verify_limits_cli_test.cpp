/// `abbe verify --details`: limits, the exit code of a failed one, and details that are refused.

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "synthetic_model.hpp"
#include "verify_cli_fixture.hpp"

namespace abbe::daemon {
namespace {

using test::text_of;
using ::testing::AllOf;
using ::testing::HasSubstr;

struct VerifyLimitsCli : VerifyCli {};

TEST_F(VerifyLimitsCli, JudgesTheLimitsOfTheDetails) {
  write("certificate.toml", R"([person]
name = "E. Abbe"
[[equipment]]
name = "laser tracker"
serial = "4711"
used = "verification"
[verification]
date = "2026-11-26"
operator = "C. Zeiss"
u_um = 500
limit_rms_um = 5000
limit_max_um = 0.001
)");
  const auto ran =
      abbe("verify model.json --points verification.csv --details certificate.toml -o out --json");
  ASSERT_EQ(ran.exit, 0) << ran.err;

  const auto limits = nlohmann::json::parse(ran.out)["limits"];
  ASSERT_EQ(limits.size(), 2U);
  EXPECT_EQ(limits[0]["verdict"], "pass");
  // The largest residual is below U: the points do not prove that the model fails.
  EXPECT_EQ(limits[1]["verdict"], "neither");
  EXPECT_THAT(text_of(folder_ / "out/report.html"),
              AllOf(HasSubstr("laser tracker 4711"), HasSubstr("C. Zeiss"), HasSubstr("2026-11-26"),
                    HasSubstr("E. Abbe"), HasSubstr("neither")));
}

TEST_F(VerifyLimitsCli, ALimitThatFailsHasItsExitCode) {
  write("certificate.toml",
        "[verification]\ndate = \"2026-11-26\"\nu_um = 0.01\nlimit_rms_um = 0.02\n");
  const auto ran = abbe("verify model.json --points verification.csv --details certificate.toml");
  EXPECT_EQ(ran.exit, 5) << ran.err;
  EXPECT_THAT(ran.out, HasSubstr("limit 0.02 um: fail"));
}

TEST_F(VerifyLimitsCli, RefusesDetailsThatCannotBe) {
  write("limit.toml", "[verification]\ndate = \"2026-11-26\"\nlimit_rms_um = 8\n");
  const auto without_u = abbe("verify model.json --points verification.csv --details limit.toml");
  EXPECT_EQ(without_u.exit, 3);
  EXPECT_THAT(without_u.err, HasSubstr("limit_rms_um: needs u_um"));

  write("future.toml", "[verification]\ndate = \"2999-01-01\"\n");
  const auto future = abbe("verify model.json --points verification.csv --details future.toml");
  EXPECT_EQ(future.exit, 3);
  EXPECT_THAT(future.err, HasSubstr("2999-01-01 is in the future"));

  write("old.toml",
        "[verification]\n[[equipment]]\nname = \"tracker\"\n"
        "used = \"verification\"\nvalid_until = \"2026-03-31\"\n");
  const auto old = abbe("verify model.json --points verification.csv --details old.toml");
  EXPECT_EQ(old.exit, 3);
  EXPECT_THAT(old.err, HasSubstr("valid until 2026-03-31"));
}

TEST_F(VerifyLimitsCli, ALikelyMistakeIsInTheReportAndNoPass) {
  const auto document = test::synthetic_document(3);
  write("tables.json", to_json(document));
  auto points = points_of(document);
  for (auto& point : points) point.reading_m.head<2>() *= -1.0;
  write("reversed.csv", to_verification_csv(points));
  write("certificate.toml",
        "[verification]\ndate = \"2026-11-26\"\nu_um = 1\nlimit_max_um = 1e6\n");
  const auto ran =
      abbe("verify tables.json --points reversed.csv --details certificate.toml -o out");
  ASSERT_THAT(ran.out, HasSubstr("mistake?")) << ran.err;
  EXPECT_THAT(ran.out, HasSubstr("limit 1e+06 um: neither"));
  EXPECT_THAT(text_of(folder_ / "out/report.html"), HasSubstr("A mistake in the file is likely"));
}

}  // namespace
}  // namespace abbe::daemon
