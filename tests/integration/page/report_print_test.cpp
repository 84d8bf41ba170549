/// Reports printed by `abbe report --pdf` with Chromium, and read back with pdftotext: what must be
/// on the first page is there, and every page has its number and the hash of the model.
/// scripts/test-web runs it.

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <cctype>
#include <sstream>

#include "abbe/model/model_store.hpp"
#include "abbe/report/certified_values.hpp"
#include "abbe_command.hpp"
#include "synthetic_model.hpp"
#include "temporary_folder.hpp"

namespace abbe::daemon {
namespace {

using ::testing::HasSubstr;

/// Without spaces: pdftotext puts them where the font leaves space.
std::string plain(std::string text) {
  std::erase_if(text, [](unsigned char c) { return std::isspace(c) != 0; });
  return text;
}

class ReportPrint : public ::testing::Test {
 protected:
  void SetUp() override {
    auto store = ModelStore::open(folder_ / "store").value();
    id_ = store
              .add(document_, document_.verdict->accepted, document_.verdict->reasons,
                   {"turner", "spring", {}})
              .value();
  }
  /// The pages of the report as text without spaces.
  std::vector<std::string> pages(const std::string& limits) {
    test::write_text(folder_ / "details.toml",
                     "[certificate]\nnumber = \"2026-0117\"\nbegin_date = \"2024-05-17\"\n"
                     "end_date = \"2024-05-17\"\n[customer]\nname = \"Example Machining\"\n"
                     "[machine]\nserial = \"600-0815\"\n[conditions]\ntemperature_C = 20.4\n"
                     "[[equipment]]\nname = \"laser tracker\"\nserial = \"4711\"\n" +
                         limits);
    const auto ran = test::run_abbe(
        folder_, "report " + id_ + " --store store --details details.toml -o r.html --pdf r.pdf");
    EXPECT_EQ(ran.exit, 0) << ran.err;
    const std::string command =
        fmt::format("cd '{}' && pdftotext -layout r.pdf r.txt", folder_.string());
    EXPECT_EQ(std::system(command.c_str()), 0) << "pdftotext (poppler-utils)";
    std::istringstream in(test::text_of(folder_ / "r.txt"));
    std::vector<std::string> all;
    for (std::string page; std::getline(in, page, '\f');) all.push_back(plain(page));
    return all;
  }
  /// A limit that the value passes, or fails, by far.
  static std::string limit(const std::string& key, double limit_um) {
    return fmt::format("[[tolerance]]\nvalue = \"{}\"\nlimit_um = {:.6f}\n", key, limit_um);
  }
  /// The first page, with the form of every sheet.
  std::string checked_first_page(const std::vector<std::string>& all) {
    const std::string hash = model_hash(document_);
    for (std::size_t i = 0; i < all.size(); ++i) {
      EXPECT_THAT(all[i], HasSubstr(fmt::format("page{}of{}", i + 1, all.size())));
      EXPECT_THAT(all[i], HasSubstr(hash)) << "page " << i + 1;
    }
    EXPECT_GE(all.size(), 2u);
    EXPECT_LE(all.size(), 8u);
    return all.empty() ? std::string{} : all.front();
  }

  TemporaryFolder temporary_;
  const std::filesystem::path& folder_ = temporary_.path();
  ModelDocument document_ = test::synthetic_document(1);
  std::string id_;
};

TEST_F(ReportPrint, TheFirstPageHasIdentityVerdictLimitWorstAxisAndSignature) {
  const std::string page = checked_first_page(pages(limit("X.M", 1e5)));
  for (const char* const text :
       {"600-0815", "2026-0117", "Example Machining", "turner", "2024-05-17", "laser tracker 4711",
        "20.40 C", "Green: the gate accepted", "100000 um", "pass", "worst axis:", "before: |V|",
        "after: |V| is below", "Signature"})
    EXPECT_THAT(page, HasSubstr(plain(text)));
  EXPECT_THAT(page, HasSubstr(plain(document_.machine)));
}

TEST_F(ReportPrint, AFailedLimitIsOnTheFirstPage) {
  const auto values = certified_values(document_).value();
  const double half_um = 0.5e6 * values.standard.positioning[0].M.value;
  const std::string page = checked_first_page(pages(limit("X.M", half_um) + limit("Y.M", 1e5)));
  EXPECT_THAT(page, HasSubstr(plain("Fail: a value is beyond its limit. Limits: 2.")));
}

TEST_F(ReportPrint, LongVerdictsAndManyLimitsLeaveTheSignatureOnTheFirstPage) {
  document_.verdict = ModelVerdict{};
  for (int i = 0; i < 20; ++i) {
    document_.verdict->reasons.push_back(fmt::format("reason {} {}", i, std::string(90, 'x')));
    document_.verdict->notes.push_back(fmt::format("note {} of the measurement", i));
  }
  SetUp();
  std::string limits;
  for (int i = 0; i < 20; ++i) limits += limit("X.M", 1e5 + i);
  const auto all = pages(limits);
  const std::string page = checked_first_page(all);
  EXPECT_THAT(page, HasSubstr("Signature"));
  EXPECT_THAT(page, HasSubstr(plain("more reasons and notes are on the next page")));
  ASSERT_GE(all.size(), 2u);
  EXPECT_THAT(all[1] + all[2], HasSubstr("reason19"));
  EXPECT_THAT(all[1] + all[2], HasSubstr("100019um"));
}

}  // namespace
}  // namespace abbe::daemon
