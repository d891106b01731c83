// A strict reader of the HTML that vdbgeo writes: what a validator would complain of, by line.
#pragma once

#include <algorithm>
#include <set>
#include <string>
#include <vector>

namespace vdbgeo::test {

struct HtmlPage {
    std::vector<std::string> problems;
    std::set<std::string> ids;
    std::vector<std::string> links;    ///< values of href
    std::vector<std::string> sources;  ///< values of src
    std::string words;                 ///< the text outside of scripts and styles, entities as they stand
    std::string data;                  ///< of <script id="vdbgeo-data">
};

/// Every element that is not void has to be closed in order, attributes to be in double quotes and once
/// each, ids once on the page, "<" and "&" nowhere but in tags and entities.
class HtmlReader {
 public:
    static HtmlPage read(const std::string& html) {
        HtmlReader reader{html};
        reader.run();
        return std::move(reader.page_);
    }

 private:
    explicit HtmlReader(const std::string& html) : html_(html) {}

    void complain(const std::string& what) {
        const auto line =
            1 + std::count(html_.begin(),
                           html_.begin() + static_cast<std::ptrdiff_t>(std::min(at_, html_.size())), '\n');
        page_.problems.push_back("line " + std::to_string(line) + ": " + what);
    }

    void run() {
        if (html_.rfind("<!DOCTYPE html>", 0) != 0) complain("no doctype");
        at_ = std::min<std::size_t>(html_.size(), 15);
        while (at_ < html_.size() && page_.problems.size() < 20) {
            if (html_[at_] == '<')
                tag();
            else
                text();
        }
        if (!open_.empty()) complain("never closed: " + open_.back());
        for (const std::string& link : page_.links)
            if (link.rfind("#", 0) == 0 && !page_.ids.count(link.substr(1)))
                complain("leads nowhere: " + link);
    }

    void text() {
        const std::size_t end = std::min(html_.find('<', at_), html_.size());
        const std::string piece = html_.substr(at_, end - at_);
        check_entities(piece);
        page_.words += piece;
        at_ = end;
    }

    void check_entities(const std::string& text) {
        for (std::size_t i = 0; (i = text.find('&', i)) != std::string::npos; ++i) {
            const std::string entity = text.substr(i, text.find(';', i) - i + 1);
            static const std::set<std::string> known{"&amp;", "&lt;", "&gt;", "&quot;", "&#39;"};
            if (!known.count(entity)) complain("a bare & or an unknown entity: " + entity.substr(0, 20));
        }
    }

    void tag() {
        const std::size_t end = tag_end();
        const std::string inside = html_.substr(at_ + 1, end - at_ - 1);
        at_ = end + 1;
        if (inside.rfind("/", 0) == 0) {
            const std::string name = inside.substr(1);
            if (open_.empty() || open_.back() != name)
                complain("</" + name + "> where " + (open_.empty() ? "nothing" : open_.back()) + " is open");
            else
                open_.pop_back();
            return;
        }
        std::string name = inside.substr(0, inside.find_first_of(" \n/"));
        const bool closed = !inside.empty() && inside.back() == '/';
        const std::string id =
            attributes(inside.substr(name.size(), inside.size() - name.size() - (closed ? 1 : 0)));
        static const std::set<std::string> empty{"meta", "link", "img", "br", "hr", "input"};
        if (name == "script" || name == "style") return raw(name, id);
        if (!empty.count(name) && !closed) open_.push_back(name);
    }

    /// The ">" that is in no quotes.
    std::size_t tag_end() {
        bool quoted = false;
        for (std::size_t i = at_; i < html_.size(); ++i) {
            if (html_[i] == '"') quoted = !quoted;
            if (html_[i] == '>' && !quoted) return i;
        }
        complain("a tag without an end");
        return html_.size();
    }

    std::string attributes(const std::string& text) {
        std::set<std::string> seen;
        std::string id;
        for (std::size_t i = 0; i < text.size();) {
            if (text[i] == ' ' || text[i] == '\n') {
                ++i;
                continue;
            }
            const std::size_t end = std::min(text.find_first_of(" =\n", i), text.size());
            const std::string name = text.substr(i, end - i);
            i = end;
            if (!seen.insert(name).second) complain("attribute twice: " + name);
            if (i >= text.size() || text[i] != '=') continue;
            if (i + 1 >= text.size() || text[i + 1] != '"') return complain("no quotes: " + name), id;
            const std::size_t close = text.find('"', i + 2);
            const std::string value = text.substr(i + 2, close - i - 2);
            i = close + 1;
            attribute(name, value);
            if (name == "id") id = value;
        }
        return id;
    }

    void attribute(const std::string& name, const std::string& value) {
        if (name != "src" && name != "content") check_entities(value);
        if (name == "id" && !page_.ids.insert(value).second) complain("id twice: " + value);
        if (name == "href") page_.links.push_back(value);
        if (name == "src") page_.sources.push_back(value);
        if (name.rfind("on", 0) == 0) complain("a handler: " + name);
    }

    void raw(const std::string& name, const std::string& id) {
        const std::size_t end = html_.find("</" + name + ">", at_);
        if (end == std::string::npos) return complain(name + " without an end"), void(at_ = html_.size());
        if (id == "vdbgeo-data") page_.data = html_.substr(at_, end - at_);
        at_ = end + name.size() + 3;
    }

    const std::string& html_;
    std::size_t at_ = 0;
    std::vector<std::string> open_;
    HtmlPage page_;
};

}  // namespace vdbgeo::test
