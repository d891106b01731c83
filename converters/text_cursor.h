// Reads numbers and words out of text, line by line, fast and with messages that name the line.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace vdbgeo {

/// A word of a damaged file in a form fit for a one-line message: quoted, at most 40 characters, everything
/// unprintable as '.'.
std::string in_quotes(std::string_view word);

/// A position in a text. Lines end with LF, CR LF or CR; words are parted by blanks and tabs; `comment`,
/// where given, begins a remark that reaches to the end of its line. Lines without a word are passed over.
///
/// Every failure throws InvalidInput "FILE: line N: …".
class TextCursor {
 public:
    TextCursor(std::string_view text, std::string file, char comment = '\0', std::size_t line = 1);

    /// Goes to the next line that holds a word (the first call: to the first such line); false at the end.
    bool next_line();
    /// The next word of this line, empty at its end.
    std::string_view word();
    /// The next word of this line or of those after it, empty at the end of the text.
    std::string_view next_word();
    /// Passes over what this line still holds.
    void skip_line();
    /// Fails unless this line is used up.
    void expect_line_end();

    /// The next word as a number; `what` names it in the message. A float that lies between two floats
    /// becomes the nearer one; "inf" and "nan" are numbers.
    float number(const char* what);
    /// `text`, a word of this line, as such a number.
    float number_in(std::string_view text, const char* what) const;
    /// The same as doubles.
    double real(const char* what);
    double real_in(std::string_view text, const char* what) const;
    std::int64_t integer(const char* what);
    /// `text`, a part of a word of this line, as a whole number.
    std::int64_t integer_in(std::string_view text, const char* what) const;

    [[noreturn]] void fail(const std::string& message) const;

    std::size_t line() const { return line_; }
    std::size_t offset() const { return static_cast<std::size_t>(at_ - begin_); }
    std::size_t remaining() const { return static_cast<std::size_t>(end_ - at_); }
    const std::string& file() const { return file_; }

 private:
    bool at_line_end() const { return at_ == end_ || *at_ == '\n' || *at_ == '\r'; }
    bool at_blank() const { return *at_ == ' ' || *at_ == '\t' || *at_ == '\v' || *at_ == '\f'; }

    const char *begin_, *at_, *end_;
    std::string file_;
    char comment_;
    std::size_t line_;
    bool started_ = false;
};

}  // namespace vdbgeo
