//! A page of HTML that needs nothing but itself.

use std::fmt::Write;

/// Text as HTML.
pub(super) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '&' => out.push_str("&amp;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

/// A page as a list of sections. All arguments are text, unless they are said to be HTML.
#[derive(Debug, Default)]
pub(super) struct Page {
    body: String,
    /// Identifiers and headings, for the list of contents.
    contents: Vec<String>,
    /// Whether a section is open.
    open: bool,
}

impl Page {
    pub(super) fn section(&mut self, heading: &str) {
        self.close();
        let number = self.contents.len() + 1;
        let _ = writeln!(
            self.body,
            "<section id=\"s{number}\"><h2>{}</h2>",
            escaped(heading)
        );
        self.contents.push(heading.to_owned());
        self.open = true;
    }

    fn close(&mut self) {
        if std::mem::take(&mut self.open) {
            self.body.push_str("</section>\n");
        }
    }

    pub(super) fn heading(&mut self, heading: &str) {
        let _ = writeln!(self.body, "<h3>{}</h3>", escaped(heading));
    }

    pub(super) fn paragraph(&mut self, text: &str) {
        let _ = writeln!(self.body, "<p>{}</p>", escaped(text));
    }

    pub(super) fn list(&mut self, items: &[String]) {
        self.body.push_str("<ul>\n");
        for item in items {
            let _ = writeln!(self.body, "<li>{}</li>", escaped(item));
        }
        self.body.push_str("</ul>\n");
    }

    /// Columns with `numeric` names are aligned to the right: those that begin with a `#`, which is not shown.
    pub(super) fn table(&mut self, head: &[&str], rows: &[Vec<String>]) {
        let numeric: Vec<bool> = head.iter().map(|h| h.starts_with('#')).collect();
        let class = |k: usize| match numeric.get(k) {
            Some(true) => " class=\"n\"",
            _ => "",
        };
        self.body
            .push_str("<div class=\"table\" tabindex=\"0\"><table>\n<thead><tr>");
        for (k, name) in head.iter().enumerate() {
            let name = name.trim_start_matches('#');
            let _ = write!(self.body, "<th scope=\"col\"{}>{}</th>", class(k), escaped(name));
        }
        self.body.push_str("</tr></thead>\n<tbody>\n");
        for row in rows {
            self.body.push_str("<tr>");
            for (k, cell) in row.iter().enumerate() {
                let _ = write!(self.body, "<td{}>{}</td>", class(k), escaped(cell));
            }
            self.body.push_str("</tr>\n");
        }
        self.body.push_str("</tbody></table></div>\n");
    }

    /// A picture, as SVG.
    pub(super) fn figure(&mut self, svg: &str, caption: &str) {
        let _ = writeln!(
            self.body,
            "<figure>{}<figcaption>{}</figcaption></figure>",
            svg.trim(),
            escaped(caption)
        );
    }

    /// Opens and closes a group of figures, which stand side by side where there is room.
    pub(super) fn figures(&mut self, figures: &[(String, String)]) {
        self.body.push_str("<div class=\"figures\">\n");
        for (svg, caption) in figures {
            self.figure(svg, caption);
        }
        self.body.push_str("</div>\n");
    }

    /// A table to copy: cells with tabs between them, as spreadsheets take them.
    pub(super) fn copyable(&mut self, name: &str, head: &[String], rows: &[Vec<String>]) {
        let line = |cells: &[String]| {
            // Neither tabs nor line breaks may be in a cell.
            let cells = cells.iter().map(|c| c.replace(['\t', '\n', '\r'], " "));
            escaped(&cells.collect::<Vec<_>>().join("\t"))
        };
        let _ = write!(
            self.body,
            "<div class=\"copy\"><p><b>{}</b> <button type=\"button\">Copy</button></p>\n\
             <textarea readonly spellcheck=\"false\" wrap=\"off\" rows=\"8\" aria-label=\"{}\">\n{}\n",
            escaped(name),
            escaped(name),
            line(head)
        );
        for row in rows {
            self.body.push_str(&line(row));
            self.body.push('\n');
        }
        self.body.push_str("</textarea></div>\n");
    }

    /// The whole page.
    pub(super) fn finish(mut self, title: &str, subtitle: &str) -> String {
        self.close();
        let mut contents = String::new();
        for (k, heading) in self.contents.iter().enumerate() {
            let _ = writeln!(
                contents,
                "<li><a href=\"#s{}\">{}</a></li>",
                k + 1,
                escaped(heading)
            );
        }
        let (title, subtitle) = (escaped(title), escaped(subtitle));
        format!(
            "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"color-scheme\" content=\"light dark\">\n<title>{title}</title>\n<style>{STYLE}</style>\n</head>\n\
             <body>\n<header><h1>{title}</h1><p>{subtitle}</p></header>\n<nav aria-label=\"Contents\"><ol>\n{contents}</ol></nav>\n\
             <main>\n{}</main>\n<script>{SCRIPT}</script>\n</body>\n</html>\n",
            self.body
        )
    }
}

/// Pictures are drawn for light paper, and stay on it in the dark. The last section, of tables to copy, is not printed.
const STYLE: &str = "
:root{--ink:#1b2126;--soft:#56616b;--paper:#fff;--panel:#f4f6f8;--line:#d5dbe1;--link:#0b5c96}
@media (prefers-color-scheme:dark){:root{--ink:#e6eaee;--soft:#a3aeb8;--paper:#14181c;--panel:#1e2429;--line:#39424a;--link:#7fc1f2}}
*{box-sizing:border-box}
body{margin:0 auto;max-width:64rem;padding:1.5rem 1rem 4rem;color:var(--ink);background:var(--paper);
font:16px/1.55 system-ui,'Helvetica Neue',Arial,sans-serif}
h1{font-size:1.7rem;line-height:1.2;margin:0 0 .3rem;overflow-wrap:anywhere}
h2{font-size:1.25rem;margin:2.2rem 0 .6rem;padding-top:.8rem;border-top:1px solid var(--line)}
h3{font-size:1.05rem;margin:1.4rem 0 .4rem}
header p{color:var(--soft);margin:.2rem 0}
p,li{max-width:46rem;overflow-wrap:anywhere}
a{color:var(--link)}
nav ol{columns:2;column-gap:2rem;padding-left:1.3rem;margin:1rem 0;max-width:46rem}
.table{overflow-x:auto;margin:.8rem 0;border:1px solid var(--line);border-radius:.4rem}
table{border-collapse:collapse;min-width:50%;font-size:.9rem;font-variant-numeric:tabular-nums}
th,td{padding:.35rem .7rem;text-align:left;vertical-align:top;border-bottom:1px solid var(--line)}
tbody tr:last-child td{border-bottom:0}
th{background:var(--panel);font-weight:600}
th{vertical-align:bottom}.n{text-align:right}td.n{white-space:nowrap}
figure{margin:1rem 0;padding:.6rem;background:#fff;border:1px solid var(--line);border-radius:.4rem;break-inside:avoid}
figure svg{display:block;width:100%;max-width:56rem;height:auto;margin:0 auto}
figcaption{color:#3c464e;font-size:.9rem;padding:.5rem .3rem 0}
.figures{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(22rem,100%),1fr));gap:1rem}
.figures figure{margin:0}
button{font:inherit;font-size:.85rem;padding:.15rem .7rem;color:var(--ink);background:var(--panel);border:1px solid var(--line);
border-radius:.3rem;cursor:pointer}
textarea{width:100%;padding:.5rem;color:var(--ink);background:var(--panel);border:1px solid var(--line);border-radius:.4rem;
font:12px/1.4 ui-monospace,Menlo,Consolas,monospace;tab-size:14;resize:vertical}
@media (max-width:36rem){nav ol{columns:1}body{font-size:15px}}
@page{size:A4;margin:16mm}
@media print{:root{--ink:#000;--soft:#333;--paper:#fff;--panel:#f2f2f2;--line:#bbb;--link:#000}
body{max-width:none;padding:0;font-size:10pt}nav,button,.copy,main section:last-of-type{display:none}figcaption{font-size:8.5pt}h2,h3{break-after:avoid}tr,li,p{break-inside:avoid}
thead{display:table-header-group}.table{overflow:visible;border:0}table{font-size:8.5pt}th,td{padding:.15rem .4rem}.figures{grid-template-columns:1fr 1fr}a{text-decoration:none}}
";

/// Copies the text beside a button.
const SCRIPT: &str = "
for(const b of document.querySelectorAll('.copy button'))b.addEventListener('click',async()=>{
const t=b.closest('.copy').querySelector('textarea');t.select();let done=false;
try{await navigator.clipboard.writeText(t.value);done=true}catch(e){done=document.execCommand('copy')}
b.textContent=done?'Copied':'Selected: press Ctrl+C';setTimeout(()=>{b.textContent='Copy'},2000)});
";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_text_wherever_they_stand() {
        let name = "<b onclick='x'>\"&\t\n";
        let mut page = Page::default();
        page.section(name);
        page.heading(name);
        page.paragraph(name);
        page.list(&[name.to_owned()]);
        page.table(&[name], &[vec![name.to_owned()]]);
        page.figure("<svg></svg>", name);
        page.copyable(name, &[name.to_owned()], &[vec![name.to_owned(), "2".to_owned()]]);
        let html = page.finish(name, name);
        assert!(!html.contains("<b onclick") && !html.contains("'x'"));
        // Heading, its entry in the contents, four kinds of text, a head and a cell, the name of the copied table twice, its head and
        // a cell, and three at the top.
        assert_eq!(
            html.matches("&lt;b onclick=&#39;x&#39;&gt;&quot;&amp;").count(),
            15
        );
        // In the copied table a cell is a cell.
        assert!(html.contains("&quot;&amp;  \t2\n"), "{html}");
    }
}
