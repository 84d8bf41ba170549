// Digital Calibration Certificate: valid against PTB's schema, with the numbers of the report.
#include "abbe/report/calibration_certificate.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <sys/wait.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <map>

#include "synthetic_model.hpp"
#include "temporary_folder.hpp"
#include "text_files.hpp"

namespace abbe::daemon {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

CertificateDetails certificate_details() {
  CertificateDetails d;
  d.number = "2026-0117";
  d.location = "customer";
  d.laboratory = {"Example Metrology", "Messweg 1", "Braunschweig", "38116",
                  "lab@example.com",   "DE"};
  d.customer = {"Example Machining", "", "Stuttgart", "", "", "DE"};
  d.person = "E. Abbe";
  d.machine_serial = "600-0815";
  d.temperature_C = 20.4;
  d.u_temperature_K = 0.3;
  d.feed_mm_per_min = 2500.0;
  d.equipment = {{"laser tracker", "Example Instruments", "T1", "4711", "D-K-12345", "2099-12-31"}};
  return d;
}

/// Measured on 2024-05-17, or this number of days later, from 8:00 to 8:30 UTC, and identified
/// then.
ReportSubject certified_subject(unsigned seed, int days_later = 0) {
  using protocol::UtcTime;
  ReportSubject subject{.document = test::synthetic_document(seed),
                        .details = certificate_details()};
  const UtcTime last{std::chrono::seconds{1'715'934'600} + days_later * std::chrono::hours{24}};
  subject.document.created = last + std::chrono::minutes{1};
  subject.document.run = RunFigures{.residuals = {}};
  subject.document.run->conditions =
      RunConditions{.measured = std::array{last - std::chrono::minutes{30}, last}};
  return subject;
}

/// What xmllint says of a certificate; empty: it is valid.
std::string schema_faults(const std::string& certificate) {
  const TemporaryFolder folder;
  const auto file = folder.path() / "certificate.xml", output = folder.path() / "output";
  test::write_text(file, certificate);
  const std::string schemas = ABBE_TEST_DATA "/dcc";
  const auto command = fmt::format(
      "XML_CATALOG_FILES='{0}/catalog.xml' xmllint --nonet --noout --schema '{0}/dcc.xsd' '{1}' "
      ">'{2}' 2>&1",
      schemas, file.string(), output.string());
  const int status = std::system(command.c_str());
  return WIFEXITED(status) && WEXITSTATUS(status) == 0 ? "" : test::text_of(output) + "\n";
}

std::string between(const std::string& text, std::size_t& at, std::string_view begin,
                    std::string_view end) {
  const auto from = text.find(begin, at);
  if (from == std::string::npos) return {};
  const auto first = from + begin.size();
  at = text.find(end, first);
  return text.substr(first, at - first);
}

/// Value and U of each labelled number of the first result.
std::map<std::string, std::pair<std::string, std::string>> numbers_of(const std::string& xml) {
  std::map<std::string, std::pair<std::string, std::string>> all;
  const std::string results = xml.substr(xml.find("<dcc:results>"));
  for (std::size_t at = 0; at < results.find("</dcc:results>");) {
    const std::string label = between(results, at, "<si:label>", "</si:label>");
    if (label.empty()) break;
    const std::string value = between(results, at, "<si:value>", "</si:value>");
    const auto end = results.find("</si:real>", at), U = results.find("<si:uncertainty>", at);
    all[label] = {value, U < end ? between(results, at, "<si:uncertainty>", "</si:uncertainty>")
                                 : std::string{}};
  }
  return all;
}

TEST(CalibrationCertificate, IsValidAgainstTheSchema) {
  const auto as_found = calibration_certificate(certified_subject(3));
  ASSERT_TRUE(as_found) << as_found.error().text;
  EXPECT_EQ(schema_faults(*as_found), "");
  EXPECT_THAT(*as_found, AllOf(HasSubstr("beforeAdjustment"), Not(HasSubstr("afterAdjustment")),
                               HasSubstr("after an adjustment was not measured")));
  EXPECT_EQ(*as_found, calibration_certificate(certified_subject(3)).value());

  const auto both = calibration_certificate(certified_subject(3), certified_subject(4, 8));
  EXPECT_EQ(schema_faults(both.value()), "");
  EXPECT_THAT(*both, AllOf(HasSubstr(">As found<"), HasSubstr(">As left<"),
                           HasSubstr("afterAdjustment"), HasSubstr("2026-0117")));
}

TEST(CalibrationCertificate, ContainsTheDaysOfBothMeasurements) {
  const ReportSubject as_found = certified_subject(3), as_left = certified_subject(4, 8);
  const std::string text = calibration_certificate(as_found, as_left).value();
  EXPECT_THAT(text, AllOf(HasSubstr("<dcc:beginPerformanceDate>2024-05-17<"),
                          HasSubstr("<dcc:endPerformanceDate>2024-05-25<")));
  EXPECT_THAT(text.substr(text.find(">As left<")),
              HasSubstr("measured 2024-05-25T08:00:00Z to 2024-05-25T08:30:00Z (UTC)"));
  EXPECT_THAT(calibration_certificate(as_found).value(),
              HasSubstr("<dcc:endPerformanceDate>2024-05-17<"));
}

TEST(CalibrationCertificate, DatesBeforeTheMeasurementAsLeftAreNamed) {
  ReportSubject as_found = certified_subject(3);
  as_found.document.created += std::chrono::hours{24};
  as_found.details.end_date = "2024-05-18";
  as_found.details.issue_date = "2024-05-18";
  as_found.details.equipment.front().valid_until = "2024-05-18";
  EXPECT_TRUE(calibration_certificate(as_found)) << "alone";
  as_found.details.equipment.push_back({"probe", "", "", "", "", "2024-05-18"});
  as_found.details.equipment.back().use = EquipmentUse::AsLeft;
  auto refused = calibration_certificate(as_found, certified_subject(4, 8));
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().details,
              ::testing::ElementsAre(HasSubstr("end_date: 2024-05-18 is before as left ended, "
                                               "2024-05-25")));

  as_found.details.end_date = "2024-05-25";
  refused = calibration_certificate(as_found, certified_subject(4, 8));
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().details,
              ::testing::ElementsAre(HasSubstr("issue_date: 2024-05-18 is before the end"),
                                     HasSubstr("\"probe\": its calibration was valid until "
                                               "2024-05-18, as left ended 2024-05-25")));
  refused = calibration_certificate(certified_subject(3, 8), certified_subject(4));
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().details,
              ::testing::ElementsAre(HasSubstr("--as-left: measured 2024-05-17T08:00:00Z")));
}

TEST(CalibrationCertificate, StatesEquipmentWithTheMeasurementItWasUsedFor) {
  ReportSubject as_found = certified_subject(3);
  as_found.details.equipment.push_back({"probe", "", "", "", ""});
  as_found.details.equipment.back().use = EquipmentUse::AsLeft;
  const std::string text = calibration_certificate(as_found, certified_subject(4, 8)).value();
  EXPECT_EQ(schema_faults(text), "");
  const auto left = text.find(">As left<");
  EXPECT_THAT(text.substr(0, left), AllOf(HasSubstr(">laser tracker<"), Not(HasSubstr(">probe<"))));
  EXPECT_THAT(text.substr(left), AllOf(Not(HasSubstr(">laser tracker<")), HasSubstr(">probe<")));
  EXPECT_THAT(model_report(as_found).value(), Not(HasSubstr("<td>probe</td>")));
}

/// A model from files does not know when it was measured, and was perhaps identified much later.
TEST(CalibrationCertificate, OfAModelWithoutTimesNeedsTheDaysOfTheMeasurement) {
  ReportSubject subject = certified_subject(3);
  subject.document.run.reset();
  const auto refused = calibration_certificate(subject);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().details,
              ::testing::ElementsAre(HasSubstr("certificate.begin_date: the model does not have"),
                                     HasSubstr("certificate.end_date: the model does not have")));
  subject.details.begin_date = "2024-05-01";
  subject.details.end_date = subject.details.issue_date = "2024-05-02";
  EXPECT_EQ(schema_faults(calibration_certificate(subject).value()), "");
}

/// Dates of the details are local: up to 14 h before, 12 h behind UTC.
TEST(CalibrationCertificate, AcceptsLocalDaysBesideThoseOfUtc) {
  ReportSubject subject = certified_subject(3);  // 2024-05-17, 8:00 to 8:30 UTC
  subject.details.begin_date = subject.details.end_date = "2024-05-16";
  EXPECT_TRUE(calibration_certificate(subject)) << "20:00 in the west";
  subject.details.begin_date = subject.details.end_date = "2024-05-15";
  EXPECT_FALSE(calibration_certificate(subject));
  subject.details.begin_date = subject.details.end_date = "2024-05-18";
  EXPECT_FALSE(calibration_certificate(subject)) << "22:00 in the east is the 17th";
}

std::string refusal_of(const ReportSubject& subject) {
  const auto refused = calibration_certificate(subject);
  EXPECT_FALSE(refused);
  if (refused) return {};
  EXPECT_EQ(refused.error().code, ErrorCode::BadInput);
  return testing::PrintToString(refused.error().details);
}

/// A mistyped year, of a model from files, which has no time of its measurement.
TEST(CalibrationCertificate, RefusesAMeasurementAfterTheModelWasIdentified) {
  ReportSubject subject = certified_subject(3);
  subject.document.run.reset();
  subject.details.begin_date = "2024-05-16";
  subject.details.end_date = "2060-05-16";
  EXPECT_THAT(refusal_of(subject), HasSubstr("certificate.end_date: 2060-05-16 is after the model "
                                             "was identified, 2024-05-17 (UTC)"));
  EXPECT_THAT(contradictory_dates(subject, nullptr), ::testing::SizeIs(1)) << "also in a report";
  subject.details.begin_date = "2060-05-16";
  EXPECT_THAT(refusal_of(subject), HasSubstr("certificate.begin_date: 2060-05-16 is after"));
  subject.details.begin_date = subject.details.end_date = "2024-05-17";
  EXPECT_TRUE(calibration_certificate(subject));
  subject.document.created += std::chrono::hours{2};  // 10:31 UTC is the 18th in the far east
  subject.details.end_date = "2024-05-18";
  EXPECT_TRUE(calibration_certificate(subject)) << "14 h for time zones";
}

TEST(CalibrationCertificate, RefusesAModelThatWasIdentifiedBeforeItsMeasurementEnded) {
  ReportSubject subject = certified_subject(3);
  subject.document.created -= std::chrono::hours{24 * 200};  // the clock was set back
  EXPECT_THAT(refusal_of(subject), HasSubstr("one of the clocks was wrong"));
}

TEST(CalibrationCertificate, OfTheFutureIsRefused) {
  ReportSubject subject = certified_subject(3);
  subject.details.now = subject.document.created + std::chrono::hours{24};
  subject.details.issue_date = "2024-05-18";
  EXPECT_TRUE(calibration_certificate(subject));
  subject.details.issue_date = "2042-05-18";
  EXPECT_THAT(
      refusal_of(subject),
      HasSubstr("certificate.issue_date: 2042-05-18 is in the future, today is 2024-05-18"));
  subject.details.issue_date.clear();
  subject.details.now = subject.document.created - std::chrono::hours{24 * 200};
  EXPECT_THAT(refusal_of(subject), HasSubstr("which is in the future"));
}

TEST(CalibrationCertificate, HasNoYearZero) {
  EXPECT_FALSE(is_date("0000-11-25"));
  EXPECT_TRUE(is_date("0001-11-25"));
  ReportSubject subject = certified_subject(3);
  subject.details.begin_date = subject.details.end_date = "0000-11-25";
  EXPECT_THAT(refusal_of(subject), HasSubstr("dates such as"));
}

TEST(CalibrationCertificate, OfARefusedModelIsRefusedUnlessForcedAndThenStatesIt) {
  ReportSubject subject = certified_subject(3);
  subject.document.verdict = ModelVerdict{.reasons = {"larger by 418 um/m"}};
  const auto refused = calibration_certificate(subject);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::Refused);
  EXPECT_THAT(refused.error().details,
              ::testing::ElementsAre(HasSubstr("refused by the gate: larger by 418 um/m")));
  subject.forced = StoreActor{"anna", "customer insists", {}};
  const std::string text = calibration_certificate(subject).value();
  EXPECT_EQ(schema_faults(text), "");
  const auto statements = text.find("<dcc:statements>");
  ASSERT_NE(statements, std::string::npos);
  EXPECT_LT(text.find("larger by 418 um/m", statements), text.find(">Datum<"));
  EXPECT_LT(text.find("forced by anna", statements), text.find(">Datum<"));
  EXPECT_THAT(text, HasSubstr("customer insists"));
}

/// dcc:norm states that the measurement followed the standard.
TEST(CalibrationCertificate, NamesNoStandardWhoseTestWasNotMade) {
  const std::string text = calibration_certificate(certified_subject(3)).value();
  EXPECT_THAT(text,
              AllOf(HasSubstr("<dcc:norm>ISO 230-1</dcc:norm>"),
                    Not(HasSubstr("<dcc:norm>ISO 230-2")), Not(HasSubstr("<dcc:norm>ISO 230-6")),
                    HasSubstr("computed from the identified model")));
}

TEST(CalibrationCertificate, OfATravelModelIsValid) {
  ReportSubject subject = certified_subject(3);
  subject.document.model = test::synthetic_travel_model(3);
  EXPECT_EQ(schema_faults(calibration_certificate(subject).value()), "");
}

TEST(CalibrationCertificate, TheSchemaRefusesAChangedCertificate) {
  std::string text = calibration_certificate(certified_subject(3)).value();
  const auto at = text.find("<dcc:uniqueIdentifier>");
  text.erase(at, text.find('\n', at) + 1 - at);
  EXPECT_THAT(schema_faults(text), HasSubstr("uniqueIdentifier"));
}

TEST(CalibrationCertificate, HasTheNumbersOfTheReport) {
  const ReportSubject subject = certified_subject(3);
  const std::string page = model_report(subject).value();
  const auto numbers = numbers_of(calibration_certificate(subject).value());
  const auto values = certified_values(subject.document).value();
  std::size_t compared = 0;
  for (const ValueGroup& group : values.groups) {
    for (const CertifiedValue& v : group.values) {
      if (v.value.empty()) {
        EXPECT_EQ(numbers.count(v.key), 0u) << v.key;
        continue;
      }
      ++compared;
      ASSERT_EQ(numbers.count(v.key), 1u) << v.key;
      const auto& [value, U] = numbers.at(v.key);
      EXPECT_THAT(page, HasSubstr(fmt::format("<th>{}</th>", "value")));
      EXPECT_THAT(page, HasSubstr(fmt::format("{}</td><td>{}</td><td>{}</td>", v.name, value,
                                              U.empty() ? "-" : U)));
    }
  }
  EXPECT_EQ(compared, numbers.size());
  EXPECT_GT(compared, 25u);
}

TEST(CalibrationCertificate, NamesEverythingThatIsMissing) {
  ReportSubject subject = certified_subject(3);
  subject.details = {};
  subject.details.laboratory.country = "Germany";
  subject.details.begin_date = "2026-02-30";
  const auto refused = calibration_certificate(subject);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::BadInput);
  EXPECT_THAT(refused.error().details,
              ::testing::ElementsAre("certificate.number", "laboratory.name", "laboratory.city",
                                     HasSubstr("laboratory.country"), "customer.name",
                                     "customer.city", "person.name", "machine.serial",
                                     "certificate.location", HasSubstr("dates such as")));
}

TEST(CalibrationCertificate, DatesThatContradictEachOtherAreNamed) {
  ReportSubject subject = certified_subject(3);
  subject.document.run.reset();
  subject.document.created += std::chrono::hours{24 * 365 * 3};  // after these days
  subject.details.begin_date = "2026-11-25";
  subject.details.end_date = "2026-11-24";
  subject.details.issue_date = "2026-11-23";
  subject.details.equipment.front().valid_until = "2026-11-20";
  const auto refused = calibration_certificate(subject);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().details,
              ::testing::ElementsAre(HasSubstr("end_date: 2026-11-24 is before begin_date"),
                                     HasSubstr("issue_date: 2026-11-23 is before the end"),
                                     HasSubstr("\"laser tracker\": its calibration was valid until "
                                               "2026-11-20")));
}

/// A run with a tracker whose sensors were read.
void add_recorded_conditions(ReportSubject& subject) {
  RunConditions& conditions = *subject.document.run->conditions;
  conditions.temperature_K = std::array{293.65, 294.45};
  conditions.duration_s = 123.4;
  conditions.feed_m_per_s = 2.4 / 60.0;
}

TEST(CalibrationCertificate, StatesConditionsOnlyOfTheMeasurementThatHadThem) {
  ReportSubject left = certified_subject(4, 8);
  add_recorded_conditions(left);
  const std::string text = calibration_certificate(certified_subject(3), left).value();
  EXPECT_EQ(schema_faults(text), "");
  const std::string as_left = text.substr(text.find(">As left<"));
  EXPECT_THAT(text, AllOf(HasSubstr(">20.40<"), HasSubstr(">2500<")));
  EXPECT_THAT(as_left, AllOf(Not(HasSubstr(">20.40<")), HasSubstr("State of the machine"),
                             HasSubstr(">20.50<"), HasSubstr(">21.30<"), HasSubstr(">2400<")));
}

TEST(CalibrationCertificate, HasTheConditionsAndTheSoftwareOfTheReport) {
  ReportSubject subject = certified_subject(3);
  subject.details.temperature_C = subject.details.u_temperature_K = std::nullopt;
  subject.details.feed_mm_per_min.reset();
  subject.details.humidity_percent = 45.5;
  add_recorded_conditions(subject);
  subject.document.artefact = calib::Expansion{11.5e-6, 0.5e-6, 293.4, 0.15};
  subject.document.run->conditions->bar_temperature_K = std::array{293.25, 293.75};
  subject.document.software = "0.0.7-earlier";
  const std::string page = model_report(subject).value();
  const std::string text = calibration_certificate(subject).value();
  EXPECT_EQ(schema_faults(text), "");
  EXPECT_THAT(page, AllOf(HasSubstr("<td>20.50 to 21.30 C, lowest and highest value of all "
                                    "sensors</td>"),
                          HasSubstr("<td>20.25 \u00b1 0.30 C (k = 2), corrected with 11.50 um/(m "
                                    "K)</td>"),
                          HasSubstr("<td>20.10 to 20.60 C, lowest and highest value as used"),
                          HasSubstr("<td>45.5 %</td>"), HasSubstr("<td>2400 mm/min, median"),
                          HasSubstr("<td>123.4 s, from the first to the last"),
                          HasSubstr("abbe 0.0.7-earlier")));
  for (const char* const value :
       {"20.50", "21.30", "20.25", "0.30", "20.10", "20.60", "45.5", "2400", "123.4"})
    EXPECT_THAT(text, HasSubstr(fmt::format(">{}<", value)));
  EXPECT_THAT(text.substr(text.find("<dcc:usedSoftware>")), HasSubstr(">0.0.7-earlier<"));
  EXPECT_THAT(text.substr(0, text.find("<dcc:coreData>")), Not(HasSubstr("0.0.7-earlier")));
}

TEST(CalibrationCertificate, StaysValidWithHostileTexts) {
  const std::string name = "  <a>&\"'\x01\xff\xed\xa0\x80\xEF\xBF\xBF</dcc:content>\n ";
  ReportSubject subject = certified_subject(3);
  subject.document.machine = subject.document.estimator = name;
  subject.document.machine_hash.clear();
  subject.document.inputs = {{name, name}};
  subject.document.recording_gap = name;
  CertificateDetails& d = subject.details;
  d.number = d.person = d.role = d.remark = d.machine_serial = d.machine_model = name;
  d.laboratory.name = d.laboratory.city = d.customer.name = d.customer.city = name;
  d.customer.street = d.laboratory_code = name;
  d.equipment = {{name, name, name, name, name, ""}, {name, "", "", "", "", ""}};
  const auto text = calibration_certificate(subject).value();
  EXPECT_EQ(schema_faults(text), "");
  EXPECT_THAT(text, Not(HasSubstr("<a>")));

  subject.document.machine = " \t ";
  d.role = d.remark = d.customer.street = d.laboratory_code = " \n ";
  d.equipment = {{"probe", " ", " ", " ", " ", ""}};
  EXPECT_EQ(schema_faults(calibration_certificate(subject).value()), "") << "white space";
}

}  // namespace
}  // namespace abbe::daemon
