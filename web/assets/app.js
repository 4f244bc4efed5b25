document.title='Plumb'; import('three').then(t=>t);
