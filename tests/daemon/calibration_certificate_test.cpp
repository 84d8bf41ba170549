// Digital Calibration Certificate: valid against PTB's schema, with the numbers of the report.
#include "abbe/report/calibration_certificate.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <sys/wait.h>

#include <cstdlib>
#include <map>

#include "recording_fixture.hpp"
#include "synthetic_model.hpp"
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

ReportSubject certified_subject(unsigned seed) {
  return {.document = test::synthetic_document(seed), .details = certificate_details()};
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

  const auto both = calibration_certificate(certified_subject(3), certified_subject(4));
  EXPECT_EQ(schema_faults(both.value()), "");
  EXPECT_THAT(*both, AllOf(HasSubstr(">As found<"), HasSubstr(">As left<"),
                           HasSubstr("afterAdjustment"), HasSubstr("2026-0117")));
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

TEST(CalibrationCertificate, StatesConditionsOnlyOfTheMeasurementThatHadThem) {
  const std::string text =
      calibration_certificate(certified_subject(3), certified_subject(4)).value();
  const std::string as_left = text.substr(text.find(">As left<"));
  EXPECT_THAT(text, HasSubstr(">20.400<"));
  EXPECT_THAT(as_left, AllOf(Not(HasSubstr(">20.400<")), HasSubstr("State of the machine")));
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
